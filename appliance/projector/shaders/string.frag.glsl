// Light that runs along a string, from the hand to the limb that follows it.
in float across;
in float along;
in float follows;
in float chance;
uniform vec3 slack_colour;
uniform vec3 taut_colour;
uniform vec3 held_colour;
uniform float brightness;
uniform float time;
uniform int leader;
out vec4 colour;

void main() {
    float profile = max(exp(-3.5 * across * across) - 0.03, 0.0);
    float run = fract(along - 0.9 * time + chance);
    float pulse = exp(-18.0 * (1.0 - run)) + exp(-40.0 * run);
    vec3 light = mix(slack_colour, taut_colour, smoothstep(0.05, 0.5, follows));
    light = mix(light, held_colour, leader >= 0 ? smoothstep(0.35, 0.0, along) * follows : 0.0);
    float strength = 0.34 + 0.75 * follows + 1.2 * follows * pulse;
    colour = vec4(brightness * strength * profile * light, 1.0);
}
