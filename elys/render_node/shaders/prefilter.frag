#version 330 core
// What a surface of one roughness mirrors of the light around, for every direction: the first factor of the split sum.
// Karis, "Real Shading in Unreal Engine 4" (2013), with the weights of the lobe itself; samples from smaller versions of the map by their density, as in
// Krivanek and Colbert, "Real-time Shading with Filtered Importance Sampling" (2008).
#include "octahedron.glsl"
#include "sky_map.glsl"
#include "even_points.glsl"

uniform mat3 map_from_world;
uniform vec3 tile;        // lower left corner and edge of the directions' square [texels], without its border
uniform float alpha;      // roughness squared
uniform int sample_count; // 0: a mirror
uniform float sharper;     // levels of the map that are finer than the samples' density asks for: less blur, more noise
uniform vec3 light;
layout(location = 0) out vec4 radiance;

const float PI = 3.14159265359;

vec3 light_from(vec3 direction, float angle) {
    return map_light(map_from_world * direction, angle, sharper);
}

void main() {
    vec3 axis = direction_from_square((gl_FragCoord.xy - tile.xy) / tile.z * 2.0 - 1.0);
    if (sample_count == 0) {
        radiance = vec4(light * light_from(axis, 4.0 * PI / (tile.z * tile.z)), 1.0);
        return;
    }
    vec3 across = normalize(cross(axis, abs(axis.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0)));
    vec3 along = cross(axis, across);
    vec3 sum = vec3(0.0);
    float weight = 0.0;
    float a2 = alpha * alpha;
    for (int i = 0; i < sample_count; ++i) {
        vec2 p = even_point(i, sample_count);
        float cosine2 = (1.0 - p.x) / (1.0 + (a2 - 1.0) * p.x);  // of the half vector, as GGX spreads them
        float cosine = sqrt(cosine2), sine = sqrt(max(1.0 - cosine2, 0.0));
        float normal_light = 2.0 * cosine2 - 1.0;  // seen along the normal
        if (normal_light <= 0.0) continue;
        float turn = 2.0 * PI * p.y;
        vec3 half_way = (across * cos(turn) + along * sin(turn)) * sine + axis * cosine;
        // What a lobe seen along the normal reflects of it: masking and shadowing, over the density of its half vectors.
        float seen = 2.0 * normal_light / (normal_light + sqrt(a2 + (1.0 - a2) * normal_light * normal_light));
        float f = cosine2 * (a2 - 1.0) + 1.0;
        float density = a2 / (PI * f * f) * 0.25;
        sum += light_from(2.0 * cosine * half_way - axis, 1.0 / (float(sample_count) * density)) * seen;
        weight += seen;
    }
    radiance = vec4(light * sum / max(weight, 1e-6), 1.0);
}
