// How much of the light from everywhere a surface reflects: directional_albedo.py.
uniform sampler2D albedo_table;

// x: scale, y: bias of f0; z: what Fresnel takes from the layer below; w: where between the normal (0) and the mirrored way (1) the
// lobe's middle lies.
vec4 directional_albedo(float normal_view, float roughness) {
#ifdef LEAN
    // Karis, "Physically Based Shading on Mobile" (2014): within 0.03 of the table, without looking it up.
    vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float a = min(r.x * r.x, exp2(-9.28 * normal_view)) * r.x + r.y;
    // Lagarde and de Rousiers, "Moving Frostbite to PBR" (2014).
    float smoothness = 1.0 - roughness * roughness;
    return vec4(vec2(-1.04, 1.04) * a + r.zw, 0.04, smoothness * (sqrt(smoothness) + roughness * roughness));
#else
    vec2 place = vec2(sqrt(normal_view), clamp(roughness, 0.0, 1.0));
    return textureLod(albedo_table, (place * 31.0 + 0.5) / 32.0, 0.0);
#endif
}
