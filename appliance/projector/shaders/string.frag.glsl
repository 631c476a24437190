// A thread: as bright as its joint follows, with a glint of the lamp and light that runs from the hand to the joint.
in float across;
in float along;
in float follows;
in float chance;
in float glint;
in float is_held;
uniform vec3 slack_colour;
uniform vec3 taut_colour;
uniform vec3 held_colour;
uniform float brightness;
uniform float time;
out vec4 colour;

void main() {
    float profile = max(exp(-3.5 * across * across) - 0.03, 0.0);
    float run = fract(along - 0.6 * time + chance);
    float pulse = exp(-40.0 * (1.0 - run)) + exp(-80.0 * run), knot = exp(-90.0 * (1.0 - along));
    vec3 light = mix(slack_colour, taut_colour, smoothstep(0.05, 0.5, follows));
    light = mix(light, held_colour, 0.7 * is_held * smoothstep(0.4, 1.0, along));
    float strength = 0.16 + 0.60 * follows + (0.2 + 1.0 * follows) * glint + follows * (0.35 * pulse + 0.6 * knot);
    colour = vec4(brightness * strength * profile * light, 1.0);
}
