uniform sampler2DShadow shadow_map;

const float BLENDED = 0.08;  // of a map's edge, in which it goes over into the next

bool is_inside(vec3 place, float border) {
    return all(greaterThanEqual(place, vec3(border, border, 0.0))) && all(lessThanEqual(place, vec3(1.0 - border, 1.0 - border, 1.0)));
}

// The same of one cascade's map, at a place in its 0..1: a 3x3 tent out of four bilinear comparisons, or one of them where speed counts.
float mapped_sunlight(int cascade, vec3 place) {
#if CASCADES > 1
    place.xy = cascade_scale[cascade].zw + place.xy * shadow_atlas.xy;
#endif
#ifdef SINGLE_SHADOW_TAP
    return texture(shadow_map, place);
#else
    vec2 half_texel = 0.5 * cascade_scale[cascade].y * shadow_atlas.xy;
    float sum = texture(shadow_map, place + vec3(-half_texel.x, -half_texel.y, 0.0));
    sum += texture(shadow_map, place + vec3(half_texel.x, -half_texel.y, 0.0));
    sum += texture(shadow_map, place + vec3(-half_texel.x, half_texel.y, 0.0));
    sum += texture(shadow_map, place + vec3(half_texel.x, half_texel.y, 0.0));
    return 0.25 * sum;
#endif
}

// Share of the sun that reaches a point. Where the map of one cascade ends it goes over into the next.
float sunlight(vec3 relative, vec3 normal) {
    float cosine = dot(normal, sun_direction.xyz);
    float lift = 0.4 + sqrt(max(1.0 - cosine * cosine, 0.0));
#if CASCADES == 1
    vec3 place = (cascade_from_relative[0] * vec4(relative + normal * (cascade_scale[0].x * lift), 1.0)).xyz;
    return is_inside(place, 0.0) ? mapped_sunlight(0, place) : 1.0;
#else
    float lit = 0.0, left = 1.0;
    for (int cascade = 0; cascade < CASCADES; ++cascade) {
        vec3 place = (cascade_from_relative[cascade] * vec4(relative + normal * (cascade_scale[cascade].x * lift), 1.0)).xyz;
        float border = 2.0 * cascade_scale[cascade].y;  // taps at its edge would fall into another
        if (!is_inside(place, border)) continue;
        float share = left;
        if (cascade < CASCADES - 1) {
            vec2 room = min(place.xy, 1.0 - place.xy) - border;
            share *= clamp(min(room.x, room.y) / BLENDED, 0.0, 1.0);
        }
        lit += share * mapped_sunlight(cascade, place);
        left -= share;
        if (left <= 0.0) return lit;
    }
    return lit + left;
#endif
}
