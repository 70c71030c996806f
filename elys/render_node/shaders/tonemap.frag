#version 330 core
#include "frame.glsl"
#include "tonemap.glsl"

in vec2 place;
uniform sampler2D picture;
layout(location = 0) out vec4 color;

void main() {
    color = vec4(display_from_light(texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb), 1.0);
}
