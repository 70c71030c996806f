#version 330 core
#include "frame.glsl"
#include "surface.glsl"
#include "brdf.glsl"
#ifdef SURROUNDINGS
#include "environment.glsl"
#elif defined(MULTIPLE_SCATTERING)
#include "albedo.glsl"
#endif
#ifdef FOG
#include "fog.glsl"
#endif
#ifdef AMBIENT_OCCLUSION
uniform sampler2D ambient_openness;
#endif
#if defined(SURROUNDINGS) && defined(LEAN) && !defined(NORMAL_TEXTURE)
#define IRRADIANCE_OF_VERTICES
in vec3 vertex_irradiance;
#endif
#ifdef SHADOWS
#include "shadow.glsl"
#endif
#ifdef LAMP_SHADOWS
#include "lamp_shadow.glsl"
#endif
#ifdef TO_SCREEN
#include "tonemap.glsl"
#endif

in vec3 relative;
in vec3 vertex_normal;
in vec2 vertex_uv;
#ifdef VERTEX_TANGENTS
in vec4 vertex_tangent;
#endif
#ifdef VERTEX_COLORS
in vec4 vertex_color;
#endif
#ifdef METALLIC_ROUGHNESS_TEXTURE
uniform sampler2D metallic_roughness_texture;
#endif
#ifdef NORMAL_TEXTURE
uniform sampler2D normal_texture;
#endif
#ifdef OCCLUSION_TEXTURE
uniform sampler2D occlusion_texture;
#endif
#ifdef EMISSIVE_TEXTURE
uniform sampler2D emissive_texture;
#endif

layout(location = 0) out vec4 radiance;

#ifdef NORMAL_TEXTURE
// The normal map's axes: x to growing u, y to falling v. From the vertices where they bring them, else from how uv changes
// from pixel to pixel (Mikkelsen 2010), which leaves the mesh as it is.
mat3 relative_from_tangent(vec3 normal, float side) {
#ifdef VERTEX_TANGENTS
    vec3 tangent = normalize(vertex_tangent.xyz - normal * dot(normal, vertex_tangent.xyz));
    return mat3(tangent, vertex_tangent.w * side * cross(normal, tangent), normal);
#else
    vec3 px = dFdx(relative), py = dFdy(relative);
    vec2 ux = dFdx(vertex_uv), uy = dFdy(vertex_uv);
    float area = ux.x * uy.y - uy.x * ux.y;
    vec3 along_u = (px * uy.y - py * ux.y) * sign(area);
    vec3 along_v = (py * ux.x - px * uy.x) * sign(area);
    along_u -= normal * dot(normal, along_u);
    float size = length(along_u);
    if (size < 1e-12) return mat3(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), normal);
    vec3 tangent = along_u / size;
    vec3 bitangent = cross(normal, tangent);
    return mat3(tangent, dot(bitangent, along_v) > 0.0 ? -bitangent : bitangent, normal);
#endif
}
#endif

float seen_side() {
    return surface_reflection.w > 0.0 && !gl_FrontFacing ? -1.0 : 1.0;
}

vec3 smooth_normal() {
    // Interpolated normals may vanish; the maximum keeps them finite.
    return vertex_normal * (seen_side() * inversesqrt(max(dot(vertex_normal, vertex_normal), 1e-20)));
}

vec3 shading_normal() {
    vec3 normal = smooth_normal();
#ifdef NORMAL_TEXTURE
    vec3 bump = texture(normal_texture, vertex_uv).xyz * 2.0 - 1.0;
    return normalize(relative_from_tangent(normal, seen_side()) * bump);
#else
    return normal;
#endif
}

vec3 lamplight(vec3 normal, vec3 to_view, vec3 color, float metallic, float roughness) {
    vec3 sum = vec3(0.0);
    int count = int(viewport.z);
    for (int i = 0; i < count; ++i) {
        vec3 to_lamp = lamps[i].position_range.xyz - relative;
        float distance_squared = max(dot(to_lamp, to_lamp), 1e-6);
        to_lamp *= inversesqrt(distance_squared);
        float range = lamps[i].position_range.w;
        float ratio = range > 0.0 ? distance_squared / (range * range) : 0.0;
        float attenuation = clamp(1.0 - ratio * ratio, 0.0, 1.0) / distance_squared;  // KHR_lights_punctual
        float cone = clamp(dot(-to_lamp, lamps[i].direction_offset.xyz) * lamps[i].color_scale.w + lamps[i].direction_offset.w, 0.0, 1.0);
        vec3 light = reflected(normal, to_view, to_lamp, color, metallic, roughness) * lamps[i].color_scale.rgb * (attenuation * cone * cone);
#ifdef LAMP_SHADOWS
        if (light != vec3(0.0)) light *= lamplight_at(i, relative, smooth_normal());
#endif
        sum += light;
    }
    return sum;
}

#ifdef SURROUNDINGS
vec3 surrounding_light(vec3 normal, vec3 to_view, vec3 color, float metallic, float roughness) {
    float normal_view = clamp(dot(normal, to_view), 0.0, 1.0);
    vec3 albedo = directional_albedo(normal_view, roughness);
    float dielectric = (DIELECTRIC_F0 * albedo.x + albedo.y) * dielectric_gain;
    vec3 specular = mix(vec3(dielectric), (color * albedo.x + albedo.y) * metal_gain, metallic);
#ifdef MULTIPLE_SCATTERING
    vec3 diffuse = color * (1.0 - metallic) * (1.0 - dielectric);  // all that is not mirrored
#else
    vec3 diffuse = color * (1.0 - metallic) * (1.0 - DIELECTRIC_F0) * (1.0 - albedo.z);
#endif
    // What is rough mirrors more of what is above it. Lagarde and de Rousiers, "Moving Frostbite to PBR" (2014).
    float smoothness = 1.0 - roughness * roughness;
    vec3 mirrored = mix(normal, reflect(-to_view, normal), smoothness * (sqrt(smoothness) + roughness * roughness));
#ifdef IRRADIANCE_OF_VERTICES
    vec3 around = vertex_irradiance;
#else
    vec3 around = irradiance_from(normal);
#endif
    return diffuse * around + specular * mirrored_surroundings(mirrored, roughness);
}
#endif

void main() {
    vec4 color = surface_color(vertex_uv);
#ifdef VERTEX_COLORS
    color *= vertex_color;
#endif
    if (surface_reflection.z > 0.0 && color.a < surface_emissive.w) discard;
    float metallic = surface_reflection.x, roughness = surface_reflection.y, occlusion = 1.0;
#ifdef METALLIC_ROUGHNESS_TEXTURE
    vec4 texel = texture(metallic_roughness_texture, vertex_uv);
    metallic *= texel.b;
    roughness *= texel.g;
#endif
#ifdef OCCLUSION_TEXTURE
    occlusion = texture(occlusion_texture, vertex_uv).r;
#endif
    vec3 glow = surface_emissive.rgb;
#ifdef EMISSIVE_TEXTURE
    glow *= texture(emissive_texture, vertex_uv).rgb;
#endif
    vec3 normal = shading_normal();
    vec3 to_view = normalize(-relative);
#ifdef SPECULAR_ANTIALIASING
    // Tokuyoshi and Kaplanyan, "Improved Geometric Specular Antialiasing" (2019): how normals differ within a pixel is roughness.
    vec3 nx = dFdx(normal), ny = dFdy(normal);
    float spread = min(0.5 * (dot(nx, nx) + dot(ny, ny)), 0.18);
    float alpha = roughness * roughness;
    roughness = sqrt(sqrt(clamp(alpha * alpha + spread, 0.0, 1.0)));
#endif
#ifdef MULTIPLE_SCATTERING
    vec3 reach = directional_albedo(clamp(dot(normal, to_view), 0.0, 1.0), roughness);
    float lost = 1.0 / max(reach.x + reach.y, 1e-3) - 1.0;
    metal_gain = 1.0 + color.rgb * lost;
    dielectric_gain = 1.0 + DIELECTRIC_F0 * lost;
#endif
    vec3 light = glow;
#ifdef AMBIENT_OCCLUSION
    occlusion *= texelFetch(ambient_openness, ivec2(gl_FragCoord.xy), 0).r;
#endif
#ifdef SURROUNDINGS
    light += surrounding_light(normal, to_view, color.rgb, metallic, roughness) * occlusion;
#endif
    if (sun_direction.w > 0.0) {
        vec3 sun = reflected(normal, to_view, sun_direction.xyz, color.rgb, metallic, roughness) * sun_illuminance.rgb;
#ifdef SHADOWS
        if (sun != vec3(0.0)) sun *= sunlight(relative, smooth_normal());
#endif
        light += sun;
    }
    light += lamplight(normal, to_view, color.rgb, metallic, roughness);
#ifdef FOG
    light = seen_through_fog(light, relative);
#endif
#ifdef TO_SCREEN
    light = display_from_light(light);
#endif
    // Half floats end at 65504; what is brighter would become infinite and spread when samples are averaged.
    radiance = vec4(min(light, vec3(60000.0)), surface_reflection.z > 0.0 ? 1.0 : color.a);
}
