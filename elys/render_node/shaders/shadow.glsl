uniform sampler2DShadow shadow_map;

bool is_inside(vec3 place, float border) {
    return all(greaterThanEqual(place, vec3(border, border, 0.0))) && all(lessThanEqual(place, vec3(1.0 - border, 1.0 - border, 1.0)));
}

// Share of the sun that reaches a point: a 3x3 tent out of four bilinear comparisons, or one of them where speed counts.
float sunlight(vec3 relative, vec3 normal) {
    float cosine = dot(normal, sun_direction.xyz);
    float lift = 0.4 + sqrt(max(1.0 - cosine * cosine, 0.0));
    vec3 place = (shadow_from_relative * vec4(relative + normal * (shadow_scale.x * lift), 1.0)).xyz;
    vec2 half_texel = vec2(0.5 * shadow_scale.y);
#ifdef NEAR_SHADOW
    // Two maps side by side: the one of all on the left, the finer one around the eye on the right.
    vec3 near_place = (near_shadow_from_relative * vec4(relative + normal * (shadow_scale.z * lift), 1.0)).xyz;
    bool is_near = is_inside(near_place, 2.0 * shadow_scale.w);
    if (is_near) place = near_place;
#endif
#ifdef NEAR_SHADOW
    if (!is_near && !is_inside(place, 2.0 * shadow_scale.y)) return 1.0;  // taps at its edge would fall into the other
    place.x = 0.5 * place.x + (is_near ? 0.5 : 0.0);
    half_texel.x *= 0.5;
#else
    if (!is_inside(place, 0.0)) return 1.0;
#endif
#ifdef SINGLE_SHADOW_TAP
    return texture(shadow_map, place);
#else
    float sum = texture(shadow_map, place + vec3(-half_texel.x, -half_texel.y, 0.0));
    sum += texture(shadow_map, place + vec3(half_texel.x, -half_texel.y, 0.0));
    sum += texture(shadow_map, place + vec3(-half_texel.x, half_texel.y, 0.0));
    sum += texture(shadow_map, place + vec3(half_texel.x, half_texel.y, 0.0));
    return 0.25 * sum;
#endif
}
