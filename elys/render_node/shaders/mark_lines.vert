#version 330 core
#include "frame.glsl"
// A line segment an instance, as a strip of two triangles that faces the screen, some pixels wide.
uniform sampler2D mark_texels;  // three a segment: end and width [pixels]; other end and opacity where hidden; sRGB
out vec2 across_depth;  // [pixels] from the middle times depth, and depth: their ratio is even on the screen
flat out float half_width;      // [pixels]
flat out vec4 tint;

const int COLUMNS = 768;

vec4 texel(int number) {
    return texelFetch(mark_texels, ivec2(number % COLUMNS, number / COLUMNS), 0);
}

void main() {
    vec4 first = texel(3 * gl_InstanceID), second = texel(3 * gl_InstanceID + 1);
    tint = vec4(texel(3 * gl_InstanceID + 2).rgb, second.w);
    half_width = 0.5 * first.w;
    vec4 start = clip_from_relative * vec4(first.xyz, 1.0), end = clip_from_relative * vec4(second.xyz, 1.0);
    // What lies behind the near plane has no place on the screen: the segment begins there.
    float before = start.z + start.w, after = end.z + end.w;
    if (before <= 0.0 && after <= 0.0) {
        gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
        return;
    }
    if (before < 0.0) start = mix(start, end, before / (before - after) + 1e-5);
    if (after < 0.0) end = mix(end, start, after / (after - before) + 1e-5);
    vec2 along = (end.xy / end.w - start.xy / start.w) * viewport.xy;
    float extent = length(along);
    along = extent > 1e-4 ? along / extent : vec2(1.0, 0.0);
    bool is_end = (gl_VertexID & 1) == 1;
    float side = gl_VertexID < 2 ? -1.0 : 1.0;
    vec4 place = is_end ? end : start;
    across_depth = vec2(side * (half_width + 1.5), 1.0) * place.w;
    vec2 offset = side * vec2(-along.y, along.x) * (half_width + 1.5) + (is_end ? 0.5 : -0.5) * along;
    gl_Position = vec4(place.xy + offset * 2.0 / viewport.xy * place.w, place.zw);
}
