// An instance's material: its numbers, and its textures where the program is compiled for them.
flat in vec4 surface_base;
flat in vec4 surface_emissive;
flat in vec2 surface_reflection;
in vec2 vertex_uv;
#ifdef SECOND_UVS
in vec2 vertex_second_uv;
#endif

// Mirrored repetition along the chosen axes: 0 1 0 1 ... where coordinates go 0 1 2 3.
vec2 folded(vec2 uv, bvec2 axes) {
    return mix(uv, 1.0 - abs(mod(uv, 2.0) - 1.0), axes);
}

// For each texture: its image, and, where the program is compiled for a change of coordinates, the matrix that makes it. The
// definition of NAME_UV, made with the program, says where the image is looked up.
#ifdef BASE_COLOR_TEXTURE
uniform sampler2D base_color_texture;
uniform mat3x2 base_color_from_mesh;
#ifndef BASE_COLOR_UV
#define BASE_COLOR_UV vertex_uv
#endif
#endif
#ifdef METALLIC_ROUGHNESS_TEXTURE
uniform sampler2D metallic_roughness_texture;
uniform mat3x2 metallic_roughness_from_mesh;
#ifndef METALLIC_ROUGHNESS_UV
#define METALLIC_ROUGHNESS_UV vertex_uv
#endif
#endif
#ifdef NORMAL_TEXTURE
uniform sampler2D normal_texture;
uniform mat3x2 normal_from_mesh;
#ifndef NORMAL_UV
#define NORMAL_UV vertex_uv
#endif
#endif
#ifdef OCCLUSION_TEXTURE
uniform sampler2D occlusion_texture;
uniform mat3x2 occlusion_from_mesh;
#ifndef OCCLUSION_UV
#define OCCLUSION_UV vertex_uv
#endif
#endif
#ifdef EMISSIVE_TEXTURE
uniform sampler2D emissive_texture;
uniform mat3x2 emissive_from_mesh;
#ifndef EMISSIVE_UV
#define EMISSIVE_UV vertex_uv
#endif
#endif
#ifdef SPECULAR_TEXTURE
uniform sampler2D specular_texture;
uniform mat3x2 specular_from_mesh;
#ifndef SPECULAR_UV
#define SPECULAR_UV vertex_uv
#endif
#endif
#ifdef SPECULAR_COLOR_TEXTURE
uniform sampler2D specular_color_texture;
uniform mat3x2 specular_color_from_mesh;
#ifndef SPECULAR_COLOR_UV
#define SPECULAR_COLOR_UV vertex_uv
#endif
#endif
#ifdef CLEARCOAT_TEXTURE
uniform sampler2D clearcoat_texture;
uniform mat3x2 clearcoat_from_mesh;
#ifndef CLEARCOAT_UV
#define CLEARCOAT_UV vertex_uv
#endif
#endif
#ifdef CLEARCOAT_ROUGHNESS_TEXTURE
uniform sampler2D clearcoat_roughness_texture;
uniform mat3x2 clearcoat_roughness_from_mesh;
#ifndef CLEARCOAT_ROUGHNESS_UV
#define CLEARCOAT_ROUGHNESS_UV vertex_uv
#endif
#endif
#ifdef CLEARCOAT_NORMAL_TEXTURE
uniform sampler2D clearcoat_normal_texture;
uniform mat3x2 clearcoat_normal_from_mesh;
#ifndef CLEARCOAT_NORMAL_UV
#define CLEARCOAT_NORMAL_UV vertex_uv
#endif
#endif

vec4 surface_color() {
#ifdef BASE_COLOR_TEXTURE
    return surface_base * texture(base_color_texture, BASE_COLOR_UV);
#else
    return surface_base;
#endif
}

// Metallic and roughness.
vec2 surface_metal() {
#ifdef METALLIC
    vec2 metal = surface_reflection;
#else
    vec2 metal = vec2(0.0, surface_reflection.y);  // known when the shader is compiled: all of it that is for metal goes
#endif
#ifdef METALLIC_ROUGHNESS_TEXTURE
    metal *= texture(metallic_roughness_texture, METALLIC_ROUGHNESS_UV).bg;
#endif
    return metal;
}

#ifdef OCCLUSION_STRENGTH
uniform float occlusion_strength;
#endif

float surface_occlusion() {
#ifdef OCCLUSION_TEXTURE
    float seen = texture(occlusion_texture, OCCLUSION_UV).r;
#ifdef OCCLUSION_STRENGTH
    seen = 1.0 + occlusion_strength * (seen - 1.0);
#endif
    return seen;
#else
    return 1.0;
#endif
}

vec3 surface_glow() {
#ifndef GLOWING
    return vec3(0.0);
#elif defined(EMISSIVE_TEXTURE)
    return surface_emissive.rgb * texture(emissive_texture, EMISSIVE_UV).rgb;
#else
    return surface_emissive.rgb;
#endif
}

#ifdef NORMAL_TEXTURE
#ifdef NORMAL_SCALE
uniform float normal_scale;
#endif

// The normal in tangent space, of any length.
vec3 surface_bump() {
    vec3 bump = texture(normal_texture, NORMAL_UV).xyz * 2.0 - 1.0;
#ifdef NORMAL_SCALE
    bump.xy *= normal_scale;
#endif
    return bump;
}
#endif

#ifdef SPECULAR_LAYER
uniform vec4 specular_tint;  // what a dielectric mirrors head-on; w: weight of its highlights

// Of a dielectric: rgb head-on, w at grazing angles. KHR_materials_specular.
vec4 surface_specular() {
    float weight = specular_tint.w;
    vec3 f0 = specular_tint.rgb;
#ifdef SPECULAR_TEXTURE
    weight *= texture(specular_texture, SPECULAR_UV).a;
#endif
#ifdef SPECULAR_COLOR_TEXTURE
    f0 *= texture(specular_color_texture, SPECULAR_COLOR_UV).rgb;
#endif
    return vec4(min(f0, vec3(1.0)) * weight, weight);
}
#endif

#ifdef CLEARCOAT_LAYER
uniform vec2 clearcoat_share;  // share covered, roughness

vec2 surface_coat() {
    vec2 coat = clearcoat_share;
#ifdef CLEARCOAT_TEXTURE
    coat.x *= texture(clearcoat_texture, CLEARCOAT_UV).r;
#endif
#ifdef CLEARCOAT_ROUGHNESS_TEXTURE
    coat.y *= texture(clearcoat_roughness_texture, CLEARCOAT_ROUGHNESS_UV).g;
#endif
    return coat;
}
#endif
