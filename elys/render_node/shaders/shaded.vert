#version 330 core
#include "frame.glsl"
#include "instance.glsl"
#include "deform.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
#ifdef SECOND_UVS
layout(location = 12) in vec2 second_uv;
out vec2 vertex_second_uv;
#endif
#ifdef VERTEX_TANGENTS
layout(location = 3) in vec4 tangent;
out vec4 vertex_tangent;
#endif
#ifdef VERTEX_COLORS
layout(location = 4) in vec4 color;
out vec4 vertex_color;
#endif

flat out vec4 surface_base;
flat out vec4 surface_emissive;
flat out vec2 surface_reflection;
out vec3 relative;
out vec3 vertex_normal;
out vec2 vertex_uv;
#if defined(SURROUNDINGS) && defined(LEAN) && !defined(NORMAL_TEXTURE)
#include "irradiance.glsl"
out vec3 vertex_irradiance;  // it hardly changes from pixel to pixel, and costs a tenth of them
#endif

void main() {
    surface_base = base_color;
    surface_emissive = emissive;
    surface_reflection = reflection;
    prepare_deformation();
    relative = relative_from_local(deformed(position));
    vertex_normal = turned_normal(deformed_normal(normal));
    vertex_uv = uv;
#ifdef SECOND_UVS
    vertex_second_uv = second_uv;
#endif
#if defined(SURROUNDINGS) && defined(LEAN) && !defined(NORMAL_TEXTURE)
    vec3 outward = vertex_normal * inversesqrt(max(dot(vertex_normal, vertex_normal), 1e-20));
    vertex_irradiance = irradiance_from(outward);
#endif
#ifdef VERTEX_TANGENTS
    vertex_tangent = vec4(turned(deformed_direction(tangent.xyz)), tangent.w);
#endif
#ifdef VERTEX_COLORS
    vertex_color = color;
#endif
    gl_Position = clip_from_relative * vec4(relative, 1.0);
}
