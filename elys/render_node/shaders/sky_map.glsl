// Light from all around as an equirectangular map: the upper row looks up, the middle column along -z. Directions are the map's own.
uniform sampler2D sky_map;

vec2 map_place(vec3 direction) {
    return vec2(atan(direction.x, -direction.z) / 6.28318530718 + 0.5, acos(clamp(direction.y, -1.0, 1.0)) / 3.14159265359);
}

// Averaged over about that solid angle [sr], on a map that is that many levels finer.
vec3 map_light(vec3 direction, float angle, float finer) {
    vec2 size = vec2(textureSize(sky_map, 0));
    vec2 place = map_place(direction);
    float texel = 19.7392088022 * max(sin(place.y * 3.14159265359), 0.02) / (size.x * size.y);
    return textureLod(sky_map, place, max(0.5 * log2(angle / texel) - finer, 0.0)).rgb;
}
