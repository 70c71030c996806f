#version 330 core
// Instances where a vertex shader was refused: their meshes at rest.
#include "frame.glsl"
#include "instance.glsl"

layout(location = 0) in vec3 position;
#ifdef TO_TARGET
uniform mat4 target_from_relative;
#endif

void main() {
    vec4 place = vec4(relative_from_local(position), 1.0);
#ifdef TO_TARGET
    gl_Position = target_from_relative * place;
#else
    gl_Position = clip_from_relative * place;
#endif
}
