uniform sampler2DShadow shadow_map;

// Share of the sun that reaches a point: a 3x3 tent out of four bilinear comparisons, or one of them where speed counts.
float sunlight(vec3 relative, vec3 normal) {
    if (sun_illuminance.w == 0.0) return 1.0;
    float cosine = dot(normal, sun_direction.xyz);
    float slope = sqrt(max(1.0 - cosine * cosine, 0.0));
    vec3 place = (shadow_from_relative * vec4(relative + normal * shadow_scale.x * (0.4 + slope), 1.0)).xyz;
    if (any(lessThan(place, vec3(0.0))) || any(greaterThan(place, vec3(1.0)))) return 1.0;
#ifdef SINGLE_SHADOW_TAP
    return texture(shadow_map, place);
#else
    float half_texel = 0.5 * shadow_scale.y;
    float sum = texture(shadow_map, place + vec3(-half_texel, -half_texel, 0.0));
    sum += texture(shadow_map, place + vec3(half_texel, -half_texel, 0.0));
    sum += texture(shadow_map, place + vec3(-half_texel, half_texel, 0.0));
    sum += texture(shadow_map, place + vec3(half_texel, half_texel, 0.0));
    return 0.25 * sum;
#endif
}
