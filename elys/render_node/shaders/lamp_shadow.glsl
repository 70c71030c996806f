uniform sampler2DShadow lamp_shadow_map;

// Share of a lamp's light that reaches a point: as `sunlight`, in the square that looks there.
float lamplight_at(int lamp, vec3 relative, vec3 normal) {
    vec4 shadow = lamps[lamp].shadow;
    if (shadow.x < 0.0) return 1.0;
    vec3 way = relative - lamps[lamp].position_range.xyz;
    int square = int(shadow.x);
    if (shadow.y > 0.0) {
        vec3 a = abs(way);
        if (a.x >= a.y && a.x >= a.z) square += way.x > 0.0 ? 0 : 1;
        else if (a.y >= a.z) square += way.y > 0.0 ? 2 : 3;
        else square += way.z > 0.0 ? 4 : 5;
    }
    float away = length(way);
    float cosine = dot(normal, way) / max(away, 1e-6);
    float slope = sqrt(max(1.0 - cosine * cosine, 0.0));
    vec4 p = lamp_maps[square] * vec4(relative + normal * (shadow.z * away * (0.4 + slope)), 1.0);
    if (p.w <= 0.0) return 1.0;
    vec3 place = p.xyz / p.w;
    float h = 0.5 * shadow.w;
    return 0.25 * (texture(lamp_shadow_map, place + vec3(-h, -h, 0.0)) + texture(lamp_shadow_map, place + vec3(h, -h, 0.0)) +
                   texture(lamp_shadow_map, place + vec3(-h, h, 0.0)) + texture(lamp_shadow_map, place + vec3(h, h, 0.0)));
}
