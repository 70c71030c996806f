#version 330 core
#include "frame.glsl"
#include "surface.glsl"
#include "brdf.glsl"
#if defined(SPECULAR_LAYER) || defined(CLEARCOAT_LAYER)
#define LAYERED
#include "layers.glsl"
#endif
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
#ifdef VERTEX_TANGENTS
in vec4 vertex_tangent;
#endif
#ifdef VERTEX_COLORS
in vec4 vertex_color;
#endif
layout(location = 0) out vec4 radiance;

#if defined(NORMAL_TEXTURE) || defined(CLEARCOAT_NORMAL_TEXTURE)
// The normal map's axes: x to growing u, y to falling v. From the vertices where they bring them, else from how uv changes
// from pixel to pixel (Mikkelsen 2010), which leaves the mesh as it is.
mat3 relative_from_tangent(vec3 normal, vec2 uv, float side) {
#ifdef VERTEX_TANGENTS
    vec3 tangent = normalize(vertex_tangent.xyz - normal * dot(normal, vertex_tangent.xyz));
    return mat3(tangent, vertex_tangent.w * side * cross(normal, tangent), normal);
#else
    vec3 px = dFdx(relative), py = dFdy(relative);
    vec2 ux = dFdx(uv), uy = dFdy(uv);
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
#ifdef DOUBLE_SIDED
    return gl_FrontFacing ? 1.0 : -1.0;
#else
    return 1.0;
#endif
}

vec3 smooth_normal() {
    // Interpolated normals may vanish; the maximum keeps them finite.
    return vertex_normal * (seen_side() * inversesqrt(max(dot(vertex_normal, vertex_normal), 1e-20)));
}

vec3 shading_normal() {
    vec3 normal = smooth_normal();
#ifdef NORMAL_TEXTURE
    return normalize(relative_from_tangent(normal, NORMAL_UV, seen_side()) * surface_bump());
#else
    return normal;
#endif
}

#ifdef LAYERED
Layers layers;  // of the pixel

void read_layers() {
    layers = Layers(vec3(DIELECTRIC_F0), 1.0, 0.0, 0.0, smooth_normal());
#ifdef SPECULAR_LAYER
    vec4 specular = surface_specular();
    layers.dielectric_f0 = specular.rgb;
    layers.dielectric_f90 = specular.a;
#endif
#ifdef CLEARCOAT_LAYER
    vec2 coat = surface_coat();
    layers.coat = coat.x;
    layers.coat_roughness = coat.y;
#ifdef CLEARCOAT_NORMAL_TEXTURE
    vec3 bump = texture(clearcoat_normal_texture, CLEARCOAT_NORMAL_UV).xyz * 2.0 - 1.0;
    layers.coat_normal = normalize(relative_from_tangent(layers.coat_normal, CLEARCOAT_NORMAL_UV, seen_side()) * bump);
#endif
#endif
}
#endif

vec3 lit(vec3 normal, vec3 to_view, vec3 to_light, vec3 color, float metallic, float roughness) {
#ifdef LAYERED
    return reflected_by_layers(normal, to_view, to_light, color, metallic, roughness, layers);
#else
    return reflected(normal, to_view, to_light, color, metallic, roughness);
#endif
}

#ifdef FURTHER_SUNS
vec3 further_sunlight(vec3 normal, vec3 to_view, vec3 color, float metallic, float roughness) {
    vec3 sum = vec3(0.0);
    int count = int(sun_direction.w);
    for (int i = 0; i < count; ++i) {
        sum += lit(normal, to_view, further_suns[i].direction.xyz, color, metallic, roughness) * further_suns[i].illuminance.rgb;
    }
    return sum;
}
#endif

#ifdef LAMPS
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
        float share = attenuation * cone * cone;
        if (share == 0.0) continue;  // out of its range or cone: much of a scene with many lamps
        vec3 light = lit(normal, to_view, to_lamp, color, metallic, roughness) * lamps[i].color_scale.rgb * share;
#ifdef LAMP_SHADOWS
        if (light != vec3(0.0)) light *= lamplight_at(i, relative, smooth_normal());
#endif
        sum += light;
    }
    return sum;
}
#endif

#ifdef SURROUNDINGS
vec3 surrounding_light(vec3 normal, vec3 to_view, vec3 color, float metallic, float roughness) {
    vec3 dielectric_f0 = vec3(DIELECTRIC_F0);
    float dielectric_f90 = 1.0;
#ifdef SPECULAR_LAYER
    dielectric_f0 = layers.dielectric_f0;
    dielectric_f90 = layers.dielectric_f90;
#endif
#ifdef SAMPLED_SURROUNDINGS
    LightAround around = sampled_light(normal, to_view, roughness);
#elif defined(IRRADIANCE_OF_VERTICES)
    LightAround around = split_light(normal, to_view, roughness, vertex_irradiance);
#else
    LightAround around = split_light(normal, to_view, roughness, irradiance_from(normal));
#endif
#ifdef MULTIPLE_SCATTERING
    vec4 albedo = directional_albedo(clamp(dot(normal, to_view), 0.0, 1.0), roughness);
    vec3 reflected_share = (dielectric_f0 * albedo.x + dielectric_f90 * albedo.y) * dielectric_gain;
    vec3 below = (1.0 - max(reflected_share.r, max(reflected_share.g, reflected_share.b))) * around.below;
#else
    float strongest = max(dielectric_f0.r, max(dielectric_f0.g, dielectric_f0.b));
    vec3 below = (1.0 - strongest) * around.below - (dielectric_f90 - strongest) * around.below_grazing;
#endif
    vec3 dielectric = color * below + (dielectric_f0 * around.of_f0 + dielectric_f90 * around.of_f90) * dielectric_gain;
    vec3 metal = (color * around.of_f0 + around.of_f90) * metal_gain;
    vec3 sum = mix(dielectric, metal, metallic);
#ifdef CLEARCOAT_LAYER
#ifdef SAMPLED_SURROUNDINGS
    LightAround over = sampled_light(layers.coat_normal, to_view, layers.coat_roughness);
    vec3 coat = over.of_f0 + over.of_f90;
#else
    vec3 coat = mirrored_surroundings(reflect(-to_view, layers.coat_normal), layers.coat_roughness);
#endif
    sum = mix(coat, sum, below_coat(to_view, layers));
#endif
    return sum;
}
#endif

void main() {
    vec4 color = surface_color();
#ifdef VERTEX_COLORS
    color *= vertex_color;
#endif
#ifdef MASKED
    if (color.a < surface_emissive.w) discard;
#endif
#ifdef SHOWN
    radiance = vec4(SHOWN, 1.0);  // a picture of data, see passes/data.py
    return;
#endif
#ifdef UNLIT
    vec3 light = color.rgb;
#else
    vec2 metal = surface_metal();
    float metallic = metal.x, roughness = metal.y, occlusion = surface_occlusion();
    vec3 glow = surface_glow();
    vec3 normal = shading_normal();
    vec3 to_view = direction_to_eye(relative);
#ifdef LAYERED
    read_layers();
#endif
#ifdef CLEARCOAT_LAYER
    glow *= below_coat(to_view, layers);
#endif
#ifdef SPECULAR_ANTIALIASING
    // Tokuyoshi and Kaplanyan, "Improved Geometric Specular Antialiasing" (2019): how normals differ within a pixel is roughness.
    vec3 nx = dFdx(normal), ny = dFdy(normal);
    float spread = min(0.5 * (dot(nx, nx) + dot(ny, ny)), 0.18);
    float alpha = roughness * roughness;
    roughness = sqrt(sqrt(clamp(alpha * alpha + spread, 0.0, 1.0)));
#endif
#ifdef MULTIPLE_SCATTERING
    vec3 reach = directional_albedo(clamp(dot(normal, to_view), 0.0, 1.0), roughness).xyz;
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
#ifdef SUN
    vec3 sun = lit(normal, to_view, sun_direction.xyz, color.rgb, metallic, roughness) * sun_illuminance.rgb;
#ifdef SHADOWS
    if (sun != vec3(0.0)) sun *= sunlight(relative, smooth_normal());
#endif
    light += sun;
#endif
#ifdef FURTHER_SUNS
    light += further_sunlight(normal, to_view, color.rgb, metallic, roughness);
#endif
#ifdef LAMPS
    light += lamplight(normal, to_view, color.rgb, metallic, roughness);
#endif
#endif
#ifdef FOG
    light = seen_through_fog(light, relative);
#endif
#ifdef TO_SCREEN
    light = display_from_light(light);
#endif
    // Half floats end at 65504; what is brighter would become infinite and spread when samples are averaged.
#ifdef MASKED
    color.a = 1.0;
#endif
    radiance = vec4(min(light, vec3(60000.0)), color.a);
}
