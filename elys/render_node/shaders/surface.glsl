// A material: the factors, its textures where the program is compiled for them.
layout(std140) uniform Surface {
    vec4 base_color;   // linear; w: opacity
    vec4 emissive;     // radiance; w: alpha cutoff
    vec4 reflection;   // x: metallic, y: roughness, z: 1 where only opacity above the cutoff is drawn, w: 1 where seen from behind
};

#ifdef BASE_COLOR_TEXTURE
uniform sampler2D base_color_texture;
#endif

vec4 surface_color(vec2 uv) {
#ifdef BASE_COLOR_TEXTURE
    return base_color * texture(base_color_texture, uv);
#else
    return base_color;
#endif
}
