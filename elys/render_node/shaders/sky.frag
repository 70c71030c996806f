#version 330 core
#include "frame.glsl"
#include "sky_map.glsl"
#ifdef FOG
#include "fog.glsl"
#endif
#ifdef TO_SCREEN
#include "tonemap.glsl"
#endif

in vec2 place;
uniform vec3 shown;
layout(location = 0) out vec4 radiance;

void main() {
    vec4 far_point = relative_from_clip * vec4(place, 1.0, 1.0);
    vec3 direction = -direction_to_eye(far_point.xyz / far_point.w);
    vec3 light = textureLod(sky_map, map_place(map_from_world * direction), 0.0).rgb * shown;
#ifdef FOG
    light = seen_through_fog(light, direction * 1e6);
#endif
#ifdef TO_SCREEN
    light = display_from_light(light);
#endif
    radiance = vec4(light, 1.0);
}
