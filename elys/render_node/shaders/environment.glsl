// Light from everywhere, made of the scene's two colours: the background seen above the horizon, the ambient light around.

vec3 ambient_from(float up) {
    return ambient.rgb * (1.0 + 0.4 * up);
}

vec3 sky(vec3 direction) {
    float up = direction.y;
    vec3 zenith = background.rgb * vec3(0.62, 0.72, 0.88);
    vec3 horizon = mix(background.rgb, vec3(dot(background.rgb, vec3(0.2126, 0.7152, 0.0722))), 0.35) * 1.45;
    vec3 above = mix(horizon, zenith, pow(clamp(up, 0.0, 1.0), 0.55));
    vec3 below = mix(horizon * 0.62, background.rgb * 0.34, smoothstep(0.0, 0.35, -up));
    return mix(below, above, smoothstep(-0.015, 0.015, up));
}

// What a surface of that roughness mirrors. Its two ends are known; between them it goes by the width of the lobe.
vec3 mirrored_surroundings(vec3 direction, float roughness) {
    vec3 rough = ambient_from(direction.y);
    vec3 clear = max(ambient.rgb, vec3(1e-6)) / max(background.rgb, vec3(1e-6));
    vec3 sharp = sky(direction) * min(clear, vec3(1.6));  // as bright as the ambient light says, with the sky's pattern
    sharp *= ambient.r + ambient.g + ambient.b > 0.0 ? 1.0 : 0.0;
    return mix(sharp * 1.3, rough, smoothstep(0.05, 0.75, roughness));
}
