// An instance's material: its numbers, and its textures where the program is compiled for them.
flat in vec4 surface_base;
flat in vec4 surface_emissive;
flat in vec4 surface_reflection;

#ifdef BASE_COLOR_TEXTURE
uniform sampler2D base_color_texture;
#endif

vec4 surface_color(vec2 uv) {
#ifdef BASE_COLOR_TEXTURE
    return surface_base * texture(base_color_texture, uv);
#else
    return surface_base;
#endif
}
