#version 330 core
#include "instance.glsl"
#include "deform.glsl"

layout(location = 0) in vec3 position;
#ifdef MASKED
layout(location = 2) in vec2 uv;
out vec2 vertex_uv;
#ifdef SECOND_UVS
layout(location = 12) in vec2 second_uv;
out vec2 vertex_second_uv;
#endif
flat out vec4 surface_base;
flat out vec4 surface_emissive;
flat out vec2 surface_reflection;
#endif
#ifdef PICKED
flat out uint picked;
out vec3 relative;
#endif

uniform mat4 target_from_relative;

void main() {
    prepare_deformation();
    vec3 place = relative_from_local(deformed(position));
#ifdef MASKED
    vertex_uv = uv;
#ifdef SECOND_UVS
    vertex_second_uv = second_uv;
#endif
    surface_base = base_color;
    surface_emissive = emissive;
    surface_reflection = reflection;
#endif
#ifdef PICKED
    picked = entity;
    relative = place;
#endif
    gl_Position = target_from_relative * vec4(place, 1.0);
}
