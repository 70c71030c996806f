#version 330 core
// A rectangle of an overlay an instance, from `first` on.
uniform sampler2D mark_texels;  // four an overlay: x y w h [pixels]; sRGB and opacity; numbers by kind and the kind; clip [pixels]
uniform vec2 picture_size;      // [pixels]
uniform vec2 picture_corner;    // [pixels] of what is drawn in the whole picture
uniform int first;
out vec2 place;  // [pixels] in the whole picture
flat out vec4 box, tint, numbers, clip;

const int COLUMNS = 768;

vec4 texel(int number) {
    return texelFetch(mark_texels, ivec2(number % COLUMNS, number / COLUMNS), 0);
}

void main() {
    int number = 4 * (first + gl_InstanceID);
    box = texel(number);
    tint = texel(number + 1);
    numbers = texel(number + 2);
    clip = texel(number + 3);
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    place = box.xy + corner * box.zw + (2.0 * corner - 1.0);  // a pixel more on all sides: edges are smooth
    vec2 at = (place - picture_corner) / picture_size * 2.0 - 1.0;
    gl_Position = vec4(at.x, -at.y, 0.0, 1.0);
}
