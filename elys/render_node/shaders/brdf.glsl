// glTF 2.0, appendix B, in its layered form: mix(dielectric, metal, metallic). Checked against an evaluation in numpy.
const float PI = 3.14159265358979;
const float DIELECTRIC_F0 = 0.04;

// Trowbridge and Reitz (GGX). `a2` is roughness to the fourth.
float distribution(float normal_half, float a2) {
    float f = normal_half * normal_half * (a2 - 1.0) + 1.0;
    return a2 / (PI * f * f);
}

// Smith, height-correlated, with the 1 / (4 n.l n.v) of the specular BRDF in it.
float visibility(float normal_light, float normal_view, float a2) {
    float towards_view = normal_light * sqrt(normal_view * normal_view * (1.0 - a2) + a2);
    float towards_light = normal_view * sqrt(normal_light * normal_light * (1.0 - a2) + a2);
    return 0.5 / max(towards_view + towards_light, 1e-7);
}

// Schlick's share of Fresnel: 0 head-on, 1 at grazing angles.
float schlick(float cosine) {
    float grazing = 1.0 - clamp(cosine, 0.0, 1.0);
    return (grazing * grazing) * (grazing * grazing) * grazing;
}

// What light that bounces more than once between facets adds to a lobe: Turquin, "Practical multiple scattering compensation for
// microfacet models" (2019). 1 where it is not asked for.
vec3 metal_gain = vec3(1.0);
float dielectric_gain = 1.0;

// Reflected share of light from `to_light`, times n.l: [1/sr].
vec3 reflected(vec3 normal, vec3 to_view, vec3 to_light, vec3 color, float metallic, float roughness) {
    float normal_light = dot(normal, to_light);
    if (normal_light <= 0.0) return vec3(0.0);
    vec3 half_way = normalize(to_light + to_view);
    float normal_view = max(dot(normal, to_view), 1e-4);
    float normal_half = clamp(dot(normal, half_way), 0.0, 1.0);
    float a2 = max(roughness * roughness * roughness * roughness, 1e-6);
    float specular = distribution(normal_half, a2) * visibility(normal_light, normal_view, a2);
    float grazing = schlick(dot(to_view, half_way));
    float dielectric_fresnel = DIELECTRIC_F0 + (1.0 - DIELECTRIC_F0) * grazing;
    vec3 metal_fresnel = color + (1.0 - color) * grazing;
    vec3 dielectric = (1.0 - dielectric_fresnel) * color / PI + dielectric_fresnel * specular * dielectric_gain;
    return mix(dielectric, metal_fresnel * specular * metal_gain, metallic) * normal_light;
}
