#version 330 core
in vec2 place;
uniform sampler2D mask;
uniform vec4 outline_color;
layout(location = 0) out vec4 color;

// Pixels outside of the silhouette but within two pixels of it.
void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(mask, 0) - 1;
    float inside = texelFetch(mask, here, 0).r;
    float near = 0.0;
    for (int y = -2; y <= 2; ++y) {
        for (int x = -2; x <= 2; ++x) {
            float weight = clamp(2.6 - length(vec2(x, y)), 0.0, 1.0);
            near = max(near, weight * texelFetch(mask, clamp(here + ivec2(x, y), ivec2(0), last), 0).r);
        }
    }
    float edge = near * (1.0 - inside);
    if (edge <= 0.0) discard;
    color = vec4(outline_color.rgb, outline_color.a * edge);
}
