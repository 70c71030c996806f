#version 330 core
#include "frame.glsl"

// A square on the ground around the camera, as far as it sees.
out vec2 ground;  // relative x and z [m]

uniform float reach;

void main() {
    vec2 corner = vec2((gl_VertexID & 1) * 2 - 1, (gl_VertexID >> 1) * 2 - 1);
    ground = corner * reach;
    gl_Position = clip_from_relative * vec4(ground.x, -grid_origin.y, ground.y, 1.0);
}
