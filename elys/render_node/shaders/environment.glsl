// Light from all around: its irradiance, and what is mirrored of it from a square of directions a roughness, or sampled.
#include "octahedron.glsl"
#include "irradiance.glsl"
#include "albedo.glsl"
uniform sampler2D surroundings;

// What a surface gets of it. Fresnel is f0 + (f90 - f0) times Schlick's share.
struct LightAround {
    vec3 of_f0, of_f90;           // mirrored by f0 and by f90
    vec3 below, below_grazing;    // what falls on the layer below, per pi: all, and Schlick's share of it
};

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

// The split sum: Karis, "Real Shading in Unreal Engine 4" (2013).
LightAround split_light(vec3 normal, vec3 to_view, float roughness, vec3 irradiance) {
    vec4 albedo = directional_albedo(clamp(dot(normal, to_view), 0.0, 1.0), roughness);
    vec3 axis = mix(normal, reflect(-to_view, normal), albedo.w);  // what is rough mirrors more of what is above it
    vec3 mirrored = mirrored_surroundings(axis, roughness);
    return LightAround(mirrored * albedo.x, mirrored * albedo.y, irradiance, irradiance * albedo.z);
}
#ifdef SAMPLED_SURROUNDINGS
#include "sampled_surroundings.glsl"
#endif
