// Light from all around: its irradiance, and what is mirrored of it from a square of directions a roughness.
#include "octahedron.glsl"
#include "irradiance.glsl"
#include "albedo.glsl"
uniform sampler2D surroundings;

vec3 mirrored_level(vec2 square, int level) {
    vec4 tile = mirror_tiles[level];
    return textureLod(surroundings, tile.xy + square * tile.zw, 0.0).rgb;
}

vec3 mirrored_surroundings(vec3 direction, float roughness) {
    vec2 square = square_from_direction(direction) * 0.5 + 0.5;
    float level = clamp(roughness, 0.0, 1.0) * 10.0;
#ifdef LEAN
    return mirrored_level(square, int(level + 0.5));
#else
    int below = int(min(level, 9.0));
    return mix(mirrored_level(square, below), mirrored_level(square, below + 1), level - float(below));
#endif
}
