// Light from all around: its irradiance, what is mirrored of it from a square of directions a roughness, and how much of it a
// surface reflects from a table (directional_albedo.py).
#include "octahedron.glsl"
#include "irradiance.glsl"
uniform sampler2D surroundings;
uniform sampler2D albedo_table;

vec3 mirrored_level(vec2 square, int level) {
    vec4 tile = mirror_tiles[level];
    return textureLod(surroundings, tile.xy + square * tile.zw, 0.0).rgb;
}

vec3 mirrored_surroundings(vec3 direction, float roughness) {
    vec2 square = square_from_direction(direction) * 0.5 + 0.5;
    float level = clamp(roughness, 0.0, 1.0) * 5.0;
#ifdef LEAN
    return mirrored_level(square, int(level + 0.5));
#else
    int below = int(min(level, 4.0));
    return mix(mirrored_level(square, below), mirrored_level(square, below + 1), level - float(below));
#endif
}

// x: scale, y: bias of f0; z: what Fresnel takes from the layer below.
vec3 directional_albedo(float normal_view, float roughness) {
#ifdef LEAN
    // Karis, "Physically Based Shading on Mobile" (2014): within 0.03 of the table, without looking it up.
    vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float a = min(r.x * r.x, exp2(-9.28 * normal_view)) * r.x + r.y;
    return vec3(vec2(-1.04, 1.04) * a + r.zw, 0.04);
#else
    vec2 place = vec2(sqrt(normal_view), clamp(roughness, 0.0, 1.0));
    return textureLod(albedo_table, (place * 31.0 + 0.5) / 32.0, 0.0).xyz;
#endif
}
