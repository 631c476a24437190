// A brush stroke: full where the brush was slow and fresh, split into bristles where it was fast.
in float across;
in float age;
in float speed;
in float chance;
uniform float brightness;
uniform sampler2D noise;
out vec4 colour;

void main() {
    float bristle = texture(noise, vec2(age * 0.35 + chance, 0.11 * across + chance * 3.0)).b;
    float dry = 0.25 + 0.5 * smoothstep(0.5, 3.0, speed) + 0.35 * age;
    float round_off = 1.0 - across * across;
    float ink = smoothstep(dry, dry + 0.25, bristle * 0.8 + 0.75 * round_off - 0.1);
    float moving = smoothstep(0.45, 1.3, speed);
    colour = vec4(brightness * ink * moving * (1.0 - age));
}
