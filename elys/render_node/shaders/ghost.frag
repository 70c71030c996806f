#version 330 core
#include "frame.glsl"
#ifndef TO_SCREEN
vec3 linear_from_srgb(vec3 shown) {
    return mix(pow((shown + 0.055) / 1.055, vec3(2.4)), shown / 12.92, lessThanEqual(shown, vec3(0.04045)));
}
#endif
in vec3 relative;
in vec3 vertex_normal;
uniform vec4 tint;  // sRGB; w: opacity of what faces the eye
layout(location = 0) out vec4 color;

// A body of coloured air: clear where it faces the eye, dense and bright at its edge. Exposure leaves it as it is.
void main() {
    float facing = abs(dot(normalize(vertex_normal), direction_to_eye(relative)));
    float rim = (1.0 - facing) * (1.0 - facing);
    vec3 shown = tint.rgb * (0.55 + 0.45 * facing) + 0.35 * rim;
    float cover = mix(tint.w, 0.85, rim);
#ifndef TO_SCREEN
    shown = linear_from_srgb(min(shown, vec3(1.0))) / max(grid_origin.w, 1e-20);
#endif
    color = vec4(shown, cover);
}
