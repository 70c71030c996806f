#version 330 core
#include "frame.glsl"
#ifndef TO_SCREEN
vec3 linear_from_srgb(vec3 shown) {
    return mix(pow((shown + 0.055) / 1.055, vec3(2.4)), shown / 12.92, lessThanEqual(shown, vec3(0.04045)));
}
#endif
in vec2 across_depth;
flat in float half_width;
flat in vec4 tint;
layout(location = 0) out vec4 color;

// A core in the line's colour with a dark edge, so that it is seen before anything.
void main() {
    float across = abs(across_depth.x / across_depth.y);
    float core = clamp(half_width + 0.5 - across, 0.0, 1.0);
    float cover = max(core, 0.5 * clamp(half_width + 1.5 - across, 0.0, 1.0));
#ifdef HIDDEN
    cover *= tint.w;
#endif
    if (cover <= 0.004) discard;
    vec3 shown = mix(vec3(0.03), tint.rgb, core);
#ifndef TO_SCREEN
    shown = linear_from_srgb(shown) / max(grid_origin.w, 1e-20);  // so that exposure leaves it as it is
#endif
    color = vec4(shown, cover);
}
