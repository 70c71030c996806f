#version 330 core
// Smooths along edges of a finished picture. After Lottes, "FXAA" (NVIDIA, 2009), in its shortest form: four neighbours tell the
// direction, two pairs of samples along it are averaged.
in vec2 place;
uniform sampler2D picture;
layout(location = 0) out vec4 color;

float luma(vec3 c) { return dot(c, vec3(0.299, 0.587, 0.114)); }

void main() {
    vec2 texel = 1.0 / vec2(textureSize(picture, 0));
    vec2 here = gl_FragCoord.xy * texel;
    vec3 middle = texture(picture, here).rgb;
    float nw = luma(texture(picture, here + vec2(-1.0, 1.0) * texel).rgb), ne = luma(texture(picture, here + texel).rgb);
    float sw = luma(texture(picture, here - texel).rgb), se = luma(texture(picture, here + vec2(1.0, -1.0) * texel).rgb);
    float m = luma(middle);
    float least = min(m, min(min(nw, ne), min(sw, se))), most = max(m, max(max(nw, ne), max(sw, se)));
    if (most - least < max(0.0312, most * 0.125)) {
        color = vec4(middle, 1.0);
        return;
    }
    vec2 along = vec2(-((nw + ne) - (sw + se)), (nw + sw) - (ne + se));
    along.y = -along.y;
    float small = max((nw + ne + sw + se) * 0.25 / 8.0, 1.0 / 128.0);
    along = clamp(along / (min(abs(along.x), abs(along.y)) + small), -8.0, 8.0) * texel;
    vec3 near = 0.5 * (texture(picture, here - along / 6.0).rgb + texture(picture, here + along / 6.0).rgb);
    vec3 far = near * 0.5 + 0.25 * (texture(picture, here - along * 0.5).rgb + texture(picture, here + along * 0.5).rgb);
    float f = luma(far);
    color = vec4(f < least || f > most ? near : far, 1.0);
}
