// What moves vertices within their mesh: morph targets first, then the joints of a skin.
// MORPHED and SKINNED are defined where there are such; else all of it is nothing.

#if defined(SKINNED) || defined(MORPHED)
layout(location = 15) in ivec2 pose;  // first texel of the joints, first texel of the weights
uniform sampler2D pose_texels;

vec4 pose_texel(int index) {
    return texelFetch(pose_texels, ivec2(index % 1024, index / 1024), 0);
}
#endif

#ifdef SKINNED
layout(location = 13) in vec4 joints;
layout(location = 14) in vec4 joint_weights;
vec4 skin_x, skin_y, skin_z;  // rows of the joints' transforms, weighted
#endif

#ifdef MORPHED
uniform sampler2D morph_texels;
uniform int vertex_count;
uniform int target_count;
vec3 morph_place, morph_normal;

vec3 morph_texel(int index) {
    return texelFetch(morph_texels, ivec2(index % 2048, index / 2048), 0).xyz;
}
#endif

void prepare_deformation() {
#ifdef MORPHED
    morph_place = morph_normal = vec3(0.0);
    for (int target = 0; target < target_count; ++target) {
        float weight = pose_texel(pose.y + target / 4)[target % 4];
        if (weight != 0.0) {
            int index = 2 * (target * vertex_count + gl_VertexID);
            morph_place += weight * morph_texel(index);
            morph_normal += weight * morph_texel(index + 1);
        }
    }
#endif
#ifdef SKINNED
    skin_x = skin_y = skin_z = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        int index = pose.x + 3 * int(joints[i]);
        skin_x += joint_weights[i] * pose_texel(index);
        skin_y += joint_weights[i] * pose_texel(index + 1);
        skin_z += joint_weights[i] * pose_texel(index + 2);
    }
#endif
}

vec3 deformed(vec3 place) {
#ifdef MORPHED
    place += morph_place;
#endif
#ifdef SKINNED
    vec4 p = vec4(place, 1.0);
    place = vec3(dot(skin_x, p), dot(skin_y, p), dot(skin_z, p));
#endif
    return place;
}

vec3 deformed_direction(vec3 direction) {
#ifdef SKINNED
    direction = vec3(dot(skin_x.xyz, direction), dot(skin_y.xyz, direction), dot(skin_z.xyz, direction));
#endif
    return direction;
}

// By the cofactors, as `turned_normal` does.
vec3 deformed_normal(vec3 direction) {
#ifdef MORPHED
    direction = normalize(direction + morph_normal);
#endif
#ifdef SKINNED
    vec3 x = cross(skin_y.xyz, skin_z.xyz);
    vec3 y = cross(skin_z.xyz, skin_x.xyz);
    vec3 z = cross(skin_x.xyz, skin_y.xyz);
    float side = dot(skin_x.xyz, x) < 0.0 ? -1.0 : 1.0;
    direction = normalize(side * vec3(dot(x, direction), dot(y, direction), dot(z, direction)));
#endif
    return direction;
}
