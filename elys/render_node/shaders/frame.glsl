// What is the same for a whole picture. `relative` space has the world's axes and its origin in the camera's eye: 32-bit floats
// keep a millimetre there, however far from the world's origin the scene is.
struct Lamp {
    vec4 position_range;   // relative [m]; range [m], 0 for no end
    vec4 color_scale;      // intensity [cd]; scale of the cone
    vec4 direction_offset; // the way it shines; offset of the cone
    vec4 shadow;           // first square in the atlas, -1 for none; 1 for a bulb's six; normal offset a metre; texel
};

struct Sun {
    vec4 direction;    // towards it
    vec4 illuminance;  // [lx]
};

layout(std140) uniform Frame {
    mat4 clip_from_relative;
    mat4 relative_from_clip;
    vec4 sun_direction;         // towards the sun; w: number of further suns
    vec4 sun_illuminance;       // [lx]
    vec4 shadow_atlas;          // xy: how much of the atlas of the sun's shadows one map takes
    mat4 cascade_from_relative[4];  // to 0..1 in each map, the finest first
    vec4 cascade_scale[4];      // x: normal offset [m], y: texel of the map in its 0..1, zw: its lower left corner in the atlas
    vec4 irradiance[9];         // per pi, see irradiance_from
    mat3 map_from_world;        // to the map of light from around
    vec4 map_light_scale;       // what that map is multiplied with where it lights
    vec4 mirror_tiles[11];      // where the squares of each roughness are: lower left corner and edges
    vec4 grid_origin;           // xyz of the eye, x and z wrapped to the grid's period; w: exposure
    vec4 viewport;              // width, height [pixels]; z: number of lamps; w: far [m]
    vec4 fog_color;             // radiance; w: density at the eye's height [1/m]
    vec4 fog_shape;             // x: falloff with height [1/m]
    Lamp lamps[64];
    mat4 lamp_maps[16];         // to 0..1 in the atlas of lamps' shadows, before the division
    Sun further_suns[7];        // which throw no shadows
};

// From a point to the eye, or, where the view has none, against the way it looks: the eye is what goes to (0, 0, 1, 0).
vec3 direction_to_eye(vec3 point) {
    vec4 eye = relative_from_clip[2];
    return normalize(eye.w * point - eye.xyz);
}
