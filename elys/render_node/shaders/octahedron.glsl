// The sphere of directions as a square: Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors" (2014).
vec2 square_from_direction(vec3 d) {
    d /= abs(d.x) + abs(d.y) + abs(d.z);
    vec2 folded = (1.0 - abs(d.zx)) * vec2(d.x < 0.0 ? -1.0 : 1.0, d.z < 0.0 ? -1.0 : 1.0);
    return d.y < 0.0 ? folded : d.xz;
}

// Also for places up to one texel outside of the square, which lie on the other side of its edge.
vec3 direction_from_square(vec2 e) {
    if (abs(e.x) > 1.0) e = vec2((e.x < 0.0 ? -2.0 : 2.0) - e.x, -e.y);
    if (abs(e.y) > 1.0) e = vec2(-e.x, (e.y < 0.0 ? -2.0 : 2.0) - e.y);
    vec3 d = vec3(e.x, 1.0 - abs(e.x) - abs(e.y), e.y);
    if (d.y < 0.0) d.xz = (1.0 - abs(d.zx)) * vec2(d.x < 0.0 ? -1.0 : 1.0, d.z < 0.0 ? -1.0 : 1.0);
    return normalize(d);
}
