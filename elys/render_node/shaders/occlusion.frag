#version 330 core
// How open the sky above each point is, from depths around it in the picture: horizons in a few directions.
// Bavoil, Sainz, Dimitrov, "Image-Space Horizon-Based Ambient Occlusion" (2008); normals from depths.
#include "frame.glsl"
in vec2 place;
uniform sampler2D depths;
uniform float reach;     // [m]
uniform float strength;
uniform float pixels;    // how many pixels a metre is high at a distance of one metre, in a parallel view at any
layout(location = 0) out vec4 openness;

const int WAYS = 4, STEPS = 4;

vec3 point_at(vec2 here) {
    vec4 point = relative_from_clip * vec4(vec3(here, textureLod(depths, here, 0.0).r) * 2.0 - 1.0, 1.0);
    return point.xyz / point.w;
}

void main() {
    vec2 here = place * 0.5 + 0.5, texel = 1.0 / vec2(textureSize(depths, 0));
    if (textureLod(depths, here, 0.0).r >= 1.0) {
        openness = vec4(1.0);
        return;
    }
    vec3 p = point_at(here);
    // Of the two neighbours on each axis the nearer one lies on the same surface.
    vec3 left = p - point_at(here - vec2(texel.x, 0.0)), right = point_at(here + vec2(texel.x, 0.0)) - p;
    vec3 below = p - point_at(here - vec2(0.0, texel.y)), above = point_at(here + vec2(0.0, texel.y)) - p;
    vec3 x = dot(left, left) < dot(right, right) ? left : right, y = dot(below, below) < dot(above, above) ? below : above;
    vec3 n = cross(x, y);
    if (dot(n, n) < 1e-20) {
        openness = vec4(1.0);
        return;
    }
    n = normalize(n);
    vec3 forward = vec3(clip_from_relative[0].w, clip_from_relative[1].w, clip_from_relative[2].w);
    float away = dot(forward, forward) > 0.0 ? length(p) : 1.0;
    float radius = clamp(reach * pixels / away, 2.0, 128.0);
    // Another turn for each pixel of a block of 4 by 4, which the blur evens out (interleaved).
    ivec2 cell = ivec2(gl_FragCoord.xy) & 3;
    float turn = float(cell.x * 4 + cell.y) / 16.0;
    float hidden = 0.0;
    for (int way = 0; way < WAYS; ++way) {
        float angle = (float(way) + turn) * 6.28318530718 / float(WAYS);
        vec2 direction = vec2(cos(angle), sin(angle)) * texel;
        float most = 0.0;
        for (int i = 0; i < STEPS; ++i) {
            vec3 to = point_at(here + direction * radius * (float(i) + 0.5 + turn * 0.5) / float(STEPS)) - p;
            float gap = length(to);
            float sine = dot(to, n) / max(gap, 1e-6) - 0.1;  // flat surfaces of few triangles hide nothing of themselves
            most = max(most, sine * clamp(1.0 - gap * gap / (reach * reach), 0.0, 1.0));
        }
        hidden += most;
    }
    openness = vec4(clamp(1.0 - strength * hidden / float(WAYS), 0.0, 1.0));
}
