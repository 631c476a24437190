// A projector's picture has no frame: it is black where it ends.
uniform float vignette;

float edge(vec2 uv, float aspect) {
    vec2 from_edge = min(uv, 1.0 - uv) * vec2(max(aspect, 1.0), max(1.0 / aspect, 1.0));
    from_edge = max(from_edge - 0.004, 0.0);
    vec2 near = smoothstep(vec2(0.0), vec2(0.06 + 0.30 * vignette), from_edge);
    return near.x * near.y;
}

// Light in the air falls off around the picture's middle, long before it ends: else it shows the picture's frame.
float fall(vec2 uv) {
    return 1.0 - smoothstep(0.70 - 0.45 * vignette, 1.05, length(2.0 * uv - 1.0));
}

// Air that is nearly black is black where the wall shows it as grey.
uniform float toe;

vec3 deep(vec3 air, float speck) {
    float most = max(air.r, max(air.g, air.b));
    float kept = smoothstep(0.4 * toe, 2.2 * toe + 1e-4, most);
    return kept * air + (speck - 0.5) / 255.0 * step(0.001, kept);
}
