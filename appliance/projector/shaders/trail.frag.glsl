// A light that was moved: brightest where it was fast, from the fresh colour to the fading one.
in float across;
in float age;
in float speed;
in float chance;
uniform vec3 fresh_colour;
uniform vec3 old_colour;
uniform float brightness;
out vec4 colour;

void main() {
    float profile = max(exp(-3.5 * across * across) - 0.03, 0.0);
    float fading = (1.0 - age) * (1.0 - age) * smoothstep(0.0, 0.06, age);  // else it begins with a blunt end
    float fast = smoothstep(0.25, 2.2, speed);
    vec3 light = mix(old_colour, fresh_colour, fading * fading);
    colour = vec4(brightness * (0.35 + 0.65 * chance) * profile * fading * fast * light, 1.0);
}
