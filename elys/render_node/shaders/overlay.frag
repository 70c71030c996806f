#version 330 core
in vec2 place;
flat in vec4 box, tint, numbers, clip;
uniform sampler2D glyph_sheet;    // coverage
uniform sampler2D overlay_image;  // sRGB as it is, the upper row first
layout(location = 0) out vec4 color;

// Signed distance to a rectangle with round corners (Quilez, "2D distance functions").
float rounded(vec2 at, vec2 half_size, float radius) {
    vec2 q = abs(at) - half_size + radius;
    return length(max(q, 0.0)) + min(max(q.x, q.y), 0.0) - radius;
}

float cover(float distance) {
    return clamp(0.5 - distance, 0.0, 1.0);
}

// How much of the pixel is inside of a rectangle along the axes.
float inside(vec4 edges) {
    vec2 part = clamp(min(place + 0.5, edges.zw) - max(place - 0.5, edges.xy), 0.0, 1.0);
    return part.x * part.y;
}

void main() {
    int kind = int(numbers.w + 0.5);
    float part;
    color = tint;
    if (kind == 1) {
        vec2 from_corner = place - box.xy;
        if (any(lessThan(from_corner, vec2(0.0))) || any(greaterThan(from_corner, box.zw))) discard;
        vec2 texel = numbers.xy + from_corner * numbers.z;
        part = texture(glyph_sheet, texel / vec2(textureSize(glyph_sheet, 0))).r;
    } else if (kind == 2) {
        part = inside(vec4(box.xy, box.xy + box.zw));
        color *= texture(overlay_image, (place - box.xy) / box.zw);
    } else {
        float distance = rounded(place - box.xy - box.zw / 2.0, box.zw / 2.0, numbers.x);
        part = kind == 3 ? cover(distance) * cover(-distance - numbers.y) : cover(distance) * inside(clip);
    }
    color.a *= part;
    if (color.a <= 0.001) discard;
}
