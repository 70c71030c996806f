#version 330 core
// Writes instances as all passes read them (`instance.glsl`): where they are seen now, relative to the eye. It runs once for each
// instance of a picture, so that no vertex has to find out again.
layout(location = 0) in vec4 local_x;  // rows of body_from_instance, for those that ride on a body; else of world_from_instance
layout(location = 1) in vec4 local_y;
layout(location = 2) in vec4 local_z;
layout(location = 3) in vec3 low;      // what the 32 bits of a place in the world leave over [m]
layout(location = 4) in ivec2 body;    // rows among the bodies of the newest frame and of the one before, -1 for none; -2 - k: the k-th of those that are led
layout(location = 5) in vec4 base_color;
layout(location = 6) in vec2 reflection;
out vec4 row_x;
out vec4 row_y;
out vec4 row_z;
out vec4 row_base;
out vec2 row_reflection;
#ifdef WHOLE_ROWS
layout(location = 7) in vec4 emissive;
layout(location = 8) in uint entity;
layout(location = 9) in ivec2 pose;
out vec4 row_emissive;
flat out uint row_entity;
flat out ivec2 row_pose;
#endif

uniform vec3 eye_high;
uniform vec3 eye_low;

// Two numbers of 32 bits, a place and what they leave over of it. Near the eye the first difference is exact.
vec3 relative_to_eye(vec3 high, vec3 left_over) {
    return (high - eye_high) + (left_over - eye_low);
}

#ifdef LED
uniform sampler2D led_texels;  // of those that the processor places: rows of world_from_instance, then what is left over

vec4 led_texel(int index) {
    return texelFetch(led_texels, ivec2(index % 1024, index / 1024), 0);
}
#endif

#ifdef RIDING
uniform usampler2D positions_now;  // three a body, each a number of 64 bits: its low half, its high half
uniform usampler2D positions_before;
uniform sampler2D rotations_now;
uniform sampler2D rotations_before;
uniform float behind;  // what is left of the way from the frame before to the newest: 1 to 0, below 0 beyond it

const float SMALL_TURN = 0.99875;  // see rotation_path.py

ivec2 texel_of(int index) {
    return ivec2(index % 1536, index / 1536);
}

// The number's first 24 bits, and those after them.
vec2 halves_of(uvec2 word) {
    int exponent = min(int((word.y >> 20) & 0x7FFu) - 1023, 127);
    if (exponent < -70) return vec2(0.0);
    uint sign_bit = word.y & 0x80000000u;
    float high = uintBitsToFloat(sign_bit | (uint(exponent + 127) << 23) | ((word.y & 0xFFFFFu) << 3) | (word.x >> 29));
    float scale = uintBitsToFloat(sign_bit | (uint(exponent + 75) << 23));
    return vec2(high, float(word.x & 0x1FFFFFFFu) * scale);
}

vec3 place_of(usampler2D positions, int row) {
    vec2 x = halves_of(texelFetch(positions, texel_of(3 * row), 0).xy);
    vec2 y = halves_of(texelFetch(positions, texel_of(3 * row + 1), 0).xy);
    vec2 z = halves_of(texelFetch(positions, texel_of(3 * row + 2), 0).xy);
    return relative_to_eye(vec3(x.x, y.x, z.x), vec3(x.y, y.y, z.y));
}

#ifdef SPUN
uniform sampler2D spins_now;  // angular velocities [rad/s]
uniform sampler2D spins_before;
uniform float half_gap;       // [s] of simulation between the frames, halved

vec4 product(vec4 a, vec4 b) {
    return vec4(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

// About the axis that leads from start to end, by the angle nearest to the promised one of all that lead there.
vec4 spun(vec4 start, vec4 end, vec3 turn, float share) {
    const float WHOLE = 6.28318530718;
    vec4 between = normalize(product(end, vec4(-start.xyz, start.w)));
    vec3 axis = normalize(length(between.xyz) > 1e-5 ? between.xyz : turn);
    float angle = 2.0 * atan(dot(between.xyz, axis), between.w);
    angle += WHOLE * roundEven((dot(turn, axis) - angle) / WHOLE);
    float half_angle = 0.5 * angle * share;
    half_angle -= WHOLE * roundEven(half_angle / WHOLE);
    return product(vec4(axis * sin(half_angle), cos(half_angle)), start);
}
#endif

// As `rotations_between` of rotation_path.py.
vec4 rotation_between(vec4 start, vec4 end) {
    float share = 1.0 - behind;
    float alike = dot(start, end);
    vec4 target = alike < 0.0 ? -end : end;
    if (abs(alike) >= SMALL_TURN) return normalize(start * behind + target * share);
    vec4 across = target - start * abs(alike);
    float angle = atan(length(across), abs(alike));
    return normalize(start * sin(behind * angle) + target * sin(share * angle));
}

vec3 turned_by(vec4 rotation, vec3 v) {
    return v + 2.0 * cross(rotation.xyz, cross(rotation.xyz, v) + rotation.w * v);
}

void ride(inout vec4 x, inout vec4 y, inout vec4 z) {
    vec3 place = place_of(positions_now, body.x);
    ivec2 spot = ivec2(body.x % 512, body.x / 512);
    vec4 rotation = texelFetch(rotations_now, spot, 0);
    if (body.y >= 0 && behind != 0.0) {
        vec3 place_before = place_of(positions_before, body.y);
        place += behind * (place_before - place);
        ivec2 spot_before = ivec2(body.y % 512, body.y / 512);
        vec4 start = texelFetch(rotations_before, spot_before, 0);
#ifdef SPUN
        vec3 turn = (texelFetch(spins_now, spot, 0).xyz + texelFetch(spins_before, spot_before, 0).xyz) * half_gap;
        rotation = dot(turn, turn) > 4.0 ? spun(start, rotation, turn, 1.0 - behind) : rotation_between(start, rotation);
#else
        rotation = rotation_between(start, rotation);
#endif
    }
    vec3 first = turned_by(rotation, vec3(x.x, y.x, z.x));
    vec3 second = turned_by(rotation, vec3(x.y, y.y, z.y));
    vec3 third = turned_by(rotation, vec3(x.z, y.z, z.z));
    place += turned_by(rotation, vec3(x.w, y.w, z.w));
    x = vec4(first.x, second.x, third.x, place.x);
    y = vec4(first.y, second.y, third.y, place.y);
    z = vec4(first.z, second.z, third.z, place.z);
}
#endif

void main() {
    vec4 x = local_x, y = local_y, z = local_z;
    vec3 left_over = low;
#ifdef LED
    if (body.x < -1) {
        int first = 4 * (-2 - body.x);
        x = led_texel(first);
        y = led_texel(first + 1);
        z = led_texel(first + 2);
        left_over = led_texel(first + 3).xyz;
    }
#endif
    bool rides = false;
#ifdef RIDING
    rides = body.x >= 0;
    if (rides) ride(x, y, z);
#endif
    if (!rides) {
        vec3 place = relative_to_eye(vec3(x.w, y.w, z.w), left_over);
        x.w = place.x;
        y.w = place.y;
        z.w = place.z;
    }
    row_x = x;
    row_y = y;
    row_z = z;
    row_base = base_color;
    row_reflection = reflection;
#ifdef WHOLE_ROWS
    row_emissive = emissive;
    row_entity = entity;
    row_pose = pose;
#endif
    gl_Position = vec4(0.0, 0.0, 0.0, 1.0);  // nothing is drawn
}
