#version 330 core
in vec2 place;  // -1..1
uniform sampler2D picture;  // its upper row first
layout(location = 0) out vec4 color;

void main() {
    color = vec4(texture(picture, vec2(0.5, -0.5) * place + 0.5).rgb, 1.0);
}
