#version 330 core
#include "frame.glsl"
#ifdef TO_SCREEN
#include "tonemap.glsl"
#endif

in vec2 ground;
uniform float reach;
uniform vec2 axes;  // relative x of the world's z axis and z of its x axis [m]
layout(location = 0) out vec4 color;

// How much of the pixel lines of this spacing cover, each about a pixel wide.
float lines(vec2 coordinate, float spacing) {
    vec2 cell = coordinate / spacing;
    vec2 width = fwidth(cell);
    vec2 distance_to_line = abs(fract(cell - 0.5) - 0.5) / max(width, vec2(1e-6));
    vec2 cover = clamp(1.1 - distance_to_line, 0.0, 1.0) * (1.0 - smoothstep(0.25, 0.5, width));
    return max(cover.x, cover.y);
}

float axis(float offset, float width) {
    return clamp(1.4 - abs(offset) / max(width, 1e-6), 0.0, 1.0);
}

void main() {
    vec2 coordinate = ground + grid_origin.xz;
    float fade = 1.0 - smoothstep(0.35, 1.0, length(ground) / reach);
    float cover = max(0.28 * lines(coordinate, 1.0), 0.5 * lines(coordinate, 10.0));
    vec3 tint = vec3(0.28);
    vec2 width = fwidth(ground);
    float x_axis = axis(ground.y - axes.y, width.y), z_axis = axis(ground.x - axes.x, width.x);
    tint = mix(mix(tint, vec3(0.75, 0.08, 0.07), x_axis), vec3(0.07, 0.2, 0.8), z_axis);
    cover = max(cover, 0.8 * max(x_axis, z_axis)) * fade;
    if (cover <= 0.004) discard;
#ifdef TO_SCREEN
    tint = display_from_light(tint);
#endif
    color = vec4(tint, cover);
}
