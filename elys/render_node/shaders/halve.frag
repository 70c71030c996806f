#version 330 core
// A picture half as large: 13 samples in five overlapping boxes, which does not flicker. Jimenez, "Next Generation Post Processing in
// Call of Duty: Advanced Warfare" (2014).
in vec2 place;
uniform sampler2D picture;
uniform vec4 source_from_place;  // factors, and what is added
layout(location = 0) out vec4 color;

vec3 at(vec2 here, vec2 texel, float x, float y) { return texture(picture, here + vec2(x, y) * texel).rgb; }

void main() {
    vec2 texel = 1.0 / vec2(textureSize(picture, 0)), here = place * source_from_place.xy + source_from_place.zw;
    vec3 inner = at(here, texel, -1.0, -1.0) + at(here, texel, 1.0, -1.0) + at(here, texel, -1.0, 1.0) + at(here, texel, 1.0, 1.0);
    vec3 corners = at(here, texel, -2.0, -2.0) + at(here, texel, 2.0, -2.0) + at(here, texel, -2.0, 2.0) + at(here, texel, 2.0, 2.0);
    vec3 sides = at(here, texel, 0.0, -2.0) + at(here, texel, 0.0, 2.0) + at(here, texel, -2.0, 0.0) + at(here, texel, 2.0, 0.0);
    color = vec4(inner * 0.125 + corners * 0.03125 + sides * 0.0625 + at(here, texel, 0.0, 0.0) * 0.125, 1.0);
}
