// An instance: its transform, from its rows, and the numbers of its material.
layout(location = 5) in vec4 affine_x;
layout(location = 6) in vec4 affine_y;
layout(location = 7) in vec4 affine_z;
layout(location = 8) in vec4 base_color;   // linear; w: opacity
layout(location = 9) in vec4 emissive;     // radiance; w: alpha cutoff
layout(location = 10) in vec2 reflection;  // x: metallic, y: roughness
layout(location = 11) in uint entity;

vec3 relative_from_local(vec3 point) {
    vec4 p = vec4(point, 1.0);
    return vec3(dot(affine_x, p), dot(affine_y, p), dot(affine_z, p));
}

vec3 turned(vec3 direction) {
    return vec3(dot(affine_x.xyz, direction), dot(affine_y.xyz, direction), dot(affine_z.xyz, direction));
}

// Normals go by the cofactors, which are the inverse transpose times the determinant and exist for flat scales too.
vec3 turned_normal(vec3 normal) {
#ifdef EVEN_SCALE
    return turned(normal);
#else
    vec3 x = cross(affine_y.xyz, affine_z.xyz);
    vec3 y = cross(affine_z.xyz, affine_x.xyz);
    vec3 z = cross(affine_x.xyz, affine_y.xyz);
    float side = dot(affine_x.xyz, x) < 0.0 ? -1.0 : 1.0;
    return side * vec3(dot(x, normal), dot(y, normal), dot(z, normal));
#endif
}
