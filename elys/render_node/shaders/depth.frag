#version 330 core
#ifdef MASKED
#include "surface.glsl"
#endif
#ifdef PICKED
flat in uint picked;
in vec3 relative;
layout(location = 0) out uint hit_entity;
layout(location = 1) out vec4 hit_place;
#endif
#ifdef SILHOUETTE
layout(location = 0) out vec4 coverage;
#endif

void main() {
#ifdef MASKED
    if (surface_color().a < surface_emissive.w) discard;
#endif
#ifdef PICKED
    hit_entity = picked;
    hit_place = vec4(relative, 1.0);
#endif
#ifdef SILHOUETTE
    coverage = vec4(1.0);
#endif
}
