// From linear light to the picture, and steps finer than 8 bits hold; exact black stays exact black.
vec3 toned(vec3 light) {
    vec3 x = max(light, 0.0);
    return pow(x * (1.0 + 0.11 * x) / (1.0 + 0.72 * x) , vec3(1.0 / 2.2));
}

float grain(vec2 pixel) {
    return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
}

vec3 dithered(vec3 colour, vec2 pixel) {
    return colour + (grain(pixel) - 0.5) / 255.0;
}
