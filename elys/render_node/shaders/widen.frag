#version 330 core
// A smaller picture, spread by a tent of 3 by 3 samples, mixed into the one twice as large.
in vec2 place;
uniform sampler2D picture;
uniform vec4 source_from_place;  // factors, and what is added
uniform float share;
layout(location = 0) out vec4 color;

void main() {
    vec2 texel = 1.0 / vec2(textureSize(picture, 0)), here = place * source_from_place.xy + source_from_place.zw;
    vec3 sum = vec3(0.0);
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)
            sum += texture(picture, here + vec2(x, y) * texel).rgb * float((2 - abs(x)) * (2 - abs(y)));
    color = vec4(sum / 16.0, share);
}
