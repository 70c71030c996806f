// Light from all around as an equirectangular map: the upper row looks up, the middle column along -z.
uniform sampler2D sky_map;
uniform mat3 map_from_world;

vec2 map_place(vec3 direction) {
    vec3 d = map_from_world * direction;
    return vec2(atan(d.x, -d.z) / 6.28318530718 + 0.5, acos(clamp(d.y, -1.0, 1.0)) / 3.14159265359);
}
