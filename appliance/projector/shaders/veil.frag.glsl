// Glass: light catches where the surface turns away.
in vec3 place;
in vec3 normal;
in vec3 skin;
in float open;
in float mark;
uniform vec3 eye;
uniform vec3 lamp;
uniform vec3 figure_colour;
uniform vec3 light_colour;
uniform vec3 held_colour;
uniform float brightness;
out vec4 colour;

void main() {
    vec3 n = normalize(normal), to_eye = normalize(eye - place);
    float facing = abs(dot(n, to_eye));
    float rim = pow(1.0 - facing, 2.4) * smoothstep(0.0, 0.22, facing);
    float glint = pow(clamp(dot(n, normalize(lamp + to_eye)), 0.0, 1.0), 40.0);
    vec3 glass = figure_colour * (0.05 + rim) + light_colour * 0.6 * glint;
    vec3 ember = held_colour * (0.28 + 0.25 * facing + rim);
    colour = vec4(brightness * mix(glass, ember, mark), 1.0);
}
