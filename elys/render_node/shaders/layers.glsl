// What KHR_materials_ior, KHR_materials_specular and KHR_materials_clearcoat lay over the surface of brdf.glsl, after the
// formulas of their specifications.
struct Layers {
    vec3 dielectric_f0;  // what a dielectric mirrors head-on
    float dielectric_f90;  // and at grazing angles: the weight of its highlights
    float coat;  // share covered by the varnish
    float coat_roughness;
    vec3 coat_normal;
};

float microfacets(vec3 normal, vec3 to_view, vec3 to_light, vec3 half_way, float roughness) {
    float a2 = max(roughness * roughness * roughness * roughness, 1e-6);
    float normal_light = max(dot(normal, to_light), 0.0);
    float normal_view = max(dot(normal, to_view), 1e-4);
    return distribution(clamp(dot(normal, half_way), 0.0, 1.0), a2) * visibility(normal_light, normal_view, a2) * normal_light;
}

// How much of what is below the varnish is seen.
float below_coat(vec3 to_view, Layers layers) {
    return 1.0 - layers.coat * (0.04 + 0.96 * schlick(dot(layers.coat_normal, to_view)));
}

// As `reflected` of brdf.glsl.
vec3 reflected_by_layers(vec3 normal, vec3 to_view, vec3 to_light, vec3 color, float metallic, float roughness, Layers layers) {
    vec3 half_way = normalize(to_light + to_view);
    float grazing = schlick(dot(to_view, half_way));
    float normal_light = max(dot(normal, to_light), 0.0);
    float specular = microfacets(normal, to_view, to_light, half_way, roughness);
    vec3 fresnel = mix(layers.dielectric_f0, vec3(layers.dielectric_f90), grazing);
    float most = max(fresnel.r, max(fresnel.g, fresnel.b));
    vec3 dielectric = (1.0 - most) * color / PI * normal_light + fresnel * specular;
    vec3 base = mix(dielectric, (color + (1.0 - color) * grazing) * specular, metallic);
#ifdef CLEARCOAT_LAYER
    float coat = microfacets(layers.coat_normal, to_view, to_light, half_way, layers.coat_roughness);
    float through = below_coat(to_view, layers);
    return mix(vec3(coat), base, through);
#else
    return base;
#endif
}
