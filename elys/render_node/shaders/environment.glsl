// Light from everywhere, made of the scene's two colours: the background seen above the horizon, the ambient light around.

vec3 ambient_from(float up) {
    return ambient.rgb * (1.0 + 0.4 * up);
}

vec3 sky(vec3 direction) {
    float up = direction.y;
    float grey = dot(background.rgb, vec3(0.2126, 0.7152, 0.0722));
    vec3 zenith = background.rgb * vec3(0.66, 0.75, 0.9);
    vec3 horizon = mix(background.rgb, vec3(grey), 0.4) * 1.4;
    vec3 nadir = mix(background.rgb, vec3(grey), 0.55) * 0.5;
    return up > 0.0 ? mix(horizon, zenith, sqrt(up)) : mix(horizon, nadir, smoothstep(0.0, 0.5, -up));
}

// What a surface of that roughness mirrors. Its two ends are known; between them it goes by the width of the lobe.
vec3 mirrored_surroundings(vec3 direction, float roughness) {
    vec3 rough = ambient_from(direction.y);
    vec3 clear = max(ambient.rgb, vec3(1e-6)) / max(background.rgb, vec3(1e-6));
    vec3 sharp = sky(direction) * min(clear, vec3(1.6));  // as bright as the ambient light says, with the sky's pattern
    sharp *= ambient.r + ambient.g + ambient.b > 0.0 ? 1.0 : 0.0;
    return mix(sharp * 1.3, rough, smoothstep(0.05, 0.75, roughness));
}
