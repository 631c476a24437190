// A part near the floor casts a sharp shadow, a high one a soft one: red, green and blue are blurred apart.
in float height;
out vec4 colour;

void main() {
    float off = smoothstep(0.02, 0.16, height), high = smoothstep(0.22, 0.6, height);
    colour = vec4(1.0 - off, off * (1.0 - high), off * high, 1.0);
}
