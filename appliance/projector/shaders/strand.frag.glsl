// A thread of light: bright in its middle, fainter on the far side of the body; brightness wanders along it.
in float across;
in float strength;
in float facing;
in float pulse;
in float mark;
uniform vec3 near_colour;
uniform vec3 far_colour;
uniform vec3 held_colour;
uniform float brightness;
out vec4 colour;

void main() {
    float profile = exp(-3.5 * across * across) - 0.03;
    float side = smoothstep(-0.35, 0.75, facing);
    float beat = 0.62 + 0.38 * cos(6.2832 * pulse);
    vec3 light = mix(mix(far_colour * 0.16, near_colour, side), held_colour * (0.6 + 0.8 * side), mark);
    beat = mix(beat, 1.0, mark);
    colour = vec4(brightness * strength * beat * max(profile, 0.0) * light, 1.0);
}
