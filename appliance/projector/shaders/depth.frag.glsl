// How far from the lamp, in three bytes.
out vec4 colour;

void main() {
    vec3 bytes = fract(gl_FragCoord.z * vec3(1.0, 255.0, 65025.0));
    colour = vec4(bytes - bytes.yzz * vec3(1.0 / 255.0, 1.0 / 255.0, 0.0), 1.0);
}
