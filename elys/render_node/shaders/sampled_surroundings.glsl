// Light from all around, sampled for each pixel by what the surface does with it: right from every side, where the squares of
// environment.glsl hold lobes as they are seen along the normal. SAMPLED_SURROUNDINGS is the number of samples of a lobe.
#include "even_points.glsl"
#include "sky_map.glsl"

vec3 light_around(vec3 direction, float density) {
    return map_light(map_from_world * direction, 1.0 / (float(SAMPLED_SURROUNDINGS) * density), 1.0) * map_light_scale.rgb;
}

// Axes (columns) about the normal, the first in the plane of incidence.
mat3 plane_of_incidence(vec3 normal, vec3 to_view) {
    vec3 along = to_view - normal * dot(normal, to_view);
    if (dot(along, along) < 1e-8) along = cross(normal, abs(normal.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0));
    along = normalize(along);
    return mat3(along, cross(normal, along), normal);
}

LightAround sampled_light(vec3 normal, vec3 to_view, float roughness) {
    LightAround sum = LightAround(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
    mat3 axes = plane_of_incidence(normal, to_view);
    float alpha = max(roughness * roughness, 1e-3), a2 = alpha * alpha;
    float normal_view = clamp(dot(normal, to_view), 1e-4, 1.0);
    vec3 view = vec3(sqrt(1.0 - normal_view * normal_view), 0.0, normal_view);
    vec3 stretched = normalize(vec3(alpha * view.x, 0.0, view.z));
    float unmasked = 2.0 * normal_view / (normal_view + sqrt(a2 + (1.0 - a2) * normal_view * normal_view));
    for (int i = 0; i < SAMPLED_SURROUNDINGS; ++i) {
        vec2 p = even_point(i, SAMPLED_SURROUNDINGS);
        float radius = sqrt(p.x), turn = 6.28318530718 * p.y;
        float across = radius * cos(turn), within = radius * sin(turn);
        // What falls on the layer below, by its cosine. The half vector halves the angle between view and light.
        vec3 way = vec3(within, across, sqrt(1.0 - p.x));
        vec3 light = light_around(axes * way, way.z / PI);
        sum.below += light;
        sum.below_grazing += light * schlick(sqrt(max(0.5 + 0.5 * dot(way, view), 0.0)));
        // What the facets mirror, by visible normals: Heitz, "Sampling the GGX Distribution of Visible Normals" (2018).
        within = mix(sqrt(1.0 - across * across), within, 0.5 * (1.0 + stretched.z));
        float outward = sqrt(max(1.0 - across * across - within * within, 0.0));
        vec3 facet = vec3(stretched.x * outward - stretched.z * within, across, stretched.z * outward + stretched.x * within);
        facet = normalize(vec3(alpha * facet.xy, max(facet.z, 1e-6)));
        float view_half = max(dot(view, facet), 0.0);
        way = 2.0 * view_half * facet - view;
        if (way.z <= 0.0) continue;
        light = light_around(axes * way, unmasked * distribution(facet.z, a2) / (4.0 * normal_view));
        light *= 4.0 * way.z * normal_view * visibility(way.z, normal_view, a2) / unmasked;
        float grazing = schlick(view_half);
        sum.of_f0 += light * (1.0 - grazing);
        sum.of_f90 += light * grazing;
    }
    const float share = 1.0 / float(SAMPLED_SURROUNDINGS);
    return LightAround(sum.of_f0 * share, sum.of_f90 * share, sum.below * share, sum.below_grazing * share);
}
