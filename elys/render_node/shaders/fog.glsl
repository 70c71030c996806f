// Fog whose density falls exponentially with height, integrated along the way of light.
// Quilez, "Better Fog" (2010). fog_color: radiance, w: density [1/m] at the eye's height; fog_shape.x: falloff [1/m].
vec3 seen_through_fog(vec3 light, vec3 way) {
    float reach = length(way), rise = way.y * fog_shape.x;
    // (1 - exp(-r)) / r, which is 1 at 0; downwards the fog gets thicker, but not beyond all numbers.
    rise = max(rise, -60.0);
    float thickness = abs(rise) < 1e-3 ? 1.0 - 0.5 * rise : (1.0 - exp(-rise)) / rise;
    return mix(fog_color.rgb, light, exp(-min(fog_color.w * reach * thickness, 80.0)));
}
