// Khronos PBR Neutral: keeps what is below 0.8 as it is and brings only highlights down.
// https://github.com/KhronosGroup/ToneMapping, "PBR Neutral".
vec3 neutral(vec3 light) {
    const float start = 0.8 - 0.04;
    const float desaturation = 0.15;
    float least = min(light.r, min(light.g, light.b));
    float offset = least < 0.08 ? least - 6.25 * least * least : 0.04;
    light -= offset;
    float peak = max(light.r, max(light.g, light.b));
    if (peak < start) return light;
    float d = 1.0 - start;
    float new_peak = 1.0 - d * d / (peak + d - start);
    light *= new_peak / peak;
    float g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0);
    return mix(light, vec3(new_peak), g);
}

#ifdef AGX
#include "agx.glsl"
#endif

vec3 srgb_from_linear(vec3 light) {
    vec3 low = light * 12.92;
    vec3 high = 1.055 * pow(max(light, vec3(0.0)), vec3(1.0 / 2.4)) - 0.055;
    return mix(high, low, lessThanEqual(light, vec3(0.0031308)));
}

// What the screen shows for linear light.
vec3 display_from_light(vec3 light) {
    light = max(light, vec3(0.0)) * grid_origin.w;
#if defined(AGX)
    light = agx(light);
#elif !defined(UNMAPPED)
    light = neutral(light);
#endif
    return srgb_from_linear(min(light, vec3(1.0)));
}
