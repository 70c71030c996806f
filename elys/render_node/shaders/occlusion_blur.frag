#version 330 core
// Evens out the pattern of 4 by 4 pixels, within surfaces of about the same depth.
in vec2 place;
uniform sampler2D depths;
uniform sampler2D picture;
uniform float near;  // [m]
layout(location = 0) out vec4 openness;

float away(ivec2 pixel) { return near / max(1.0 - texelFetch(depths, pixel, 0).r, 1e-7); }

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy), last = textureSize(picture, 0) - 1;
    float middle = away(here), sum = 0.0, weight = 0.0;
    for (int y = -2; y < 2; ++y)
        for (int x = -2; x < 2; ++x) {
            ivec2 pixel = clamp(here + ivec2(x, y), ivec2(0), last);
            float w = clamp(1.0 - 20.0 * abs(away(pixel) - middle) / middle, 0.001, 1.0);
            sum += w * texelFetch(picture, pixel, 0).r;
            weight += w;
        }
    openness = vec4(sum / weight);
}
