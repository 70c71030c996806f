#version 330 core
in vec2 texel;
flat in vec3 tint;
uniform sampler2D letter_sheet;  // r: body, g: the dark around it
uniform vec2 opacity;  // of the body and of its edge
layout(location = 0) out vec4 color;

void main() {
    vec2 cover = texelFetch(letter_sheet, ivec2(texel), 0).rg;
    float body = opacity.x * cover.r, edge = opacity.y * cover.g;
    if (body + edge <= 0.004) discard;
    color = body > 0.0 ? vec4(tint, body) : vec4(vec3(0.0), edge);
}
