// From linear light to the picture (a gamma of 2), and finer steps than 8 bits hold; black stays exactly black.
vec3 toned(vec3 light) {
    vec3 x = max(light, 0.0);
    return sqrt(x * (1.0 + 0.11 * x) / (1.0 + 0.72 * x));
}

float grain(vec2 pixel) {
    return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
}

vec3 dithered(vec3 colour, vec2 pixel) {
    return colour + (grain(pixel) - 0.5) / 255.0;
}
