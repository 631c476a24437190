// A brush stroke: full where the brush was slow and fresh, split into bristles where it was fast.
in float across;
in float age;
in float speed;
in float chance;
uniform float brightness;
uniform sampler2D noise;
out vec4 colour;

void main() {
    float side = across + 0.25 * (texture(noise, vec2(age * 1.7 + chance, chance)).r - 0.5);
    float bristle = texture(noise, vec2(age * 0.22 + chance, 0.16 * side + chance * 3.0)).b;
    float round_off = 1.0 - side * side * side * side;
    float dry = 0.10 + 0.30 * smoothstep(0.8, 3.5, speed) + 0.55 * age;
    float ink = smoothstep(dry - 0.06, dry + 0.16, bristle) * smoothstep(0.0, 0.35, round_off);
    float moving = smoothstep(0.4, 1.0, speed);
    colour = vec4(brightness * ink * moving * (1.0 - 0.75 * age));
}
