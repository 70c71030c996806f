#version 330 core
// A letter an instance, its cell's corners on whole pixels.
uniform sampler2D mark_texels;  // two a letter: x, y of its cell in the picture and in the sheet [pixels]; sRGB
uniform vec2 picture_size;      // [pixels]
uniform vec2 cell;              // [pixels]
out vec2 texel;
flat out vec3 tint;

const int COLUMNS = 768;

void main() {
    int number = 2 * gl_InstanceID;
    vec4 places = texelFetch(mark_texels, ivec2(number % COLUMNS, number / COLUMNS), 0);
    tint = texelFetch(mark_texels, ivec2((number + 1) % COLUMNS, (number + 1) / COLUMNS), 0).rgb;
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * cell;
    texel = places.zw + corner;
    vec2 place = (places.xy + corner) / picture_size * 2.0 - 1.0;
    gl_Position = vec4(place.x, -place.y, 0.0, 1.0);
}
