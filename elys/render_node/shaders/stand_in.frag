#version 330 core
// Seen where a shader was refused.
#ifdef EXPOSED
#include "frame.glsl"
#endif
layout(location = 0) out vec4 color;

void main() {
    color = vec4(1.0, 0.0, 1.0, 1.0);
#ifdef EXPOSED
    color.rgb /= max(grid_origin.w, 1.6e-5);  // as bright on the screen at any exposure, as far as halfs go
#endif
}
