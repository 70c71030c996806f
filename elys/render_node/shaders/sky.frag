#version 330 core
#include "frame.glsl"
#include "environment.glsl"
#ifdef TO_SCREEN
#include "tonemap.glsl"
#endif

in vec2 place;
layout(location = 0) out vec4 radiance;

void main() {
    vec4 far_point = relative_from_clip * vec4(place, 1.0, 1.0);
    vec3 light = sky(-direction_to_eye(far_point.xyz / far_point.w));
#ifdef TO_SCREEN
    light = display_from_light(light);
#endif
    radiance = vec4(light, 1.0);
}
