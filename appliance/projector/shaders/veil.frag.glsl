// Glass: light catches along outlines. Alpha: how much it hides of what is drawn behind it later.
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
uniform float hides;
uniform float pixel_height;  // figure heights that a pixel takes
out vec4 colour;

const vec2 RIM = vec2(0.010, 0.060);  // figure heights from the outline: full, and none
const float THIN_RIM = 0.20;          // the mean of a rim across a limb

void main() {
    float straight = length(normal);
    vec3 n = normal / straight, to_eye = normalize(eye - place);
    float facing = abs(dot(n, to_eye)), aside = max(1.0 - facing, 0.0);
    float change = fwidth(facing) + 1e-4;
    float away = facing / change * pixel_height;  // from the outline; by its angle a limb that points at the eye is all outline
    float rim = aside * aside * sqrt(aside) * smoothstep(0.0, 0.22, facing) * (1.0 - smoothstep(RIM.x, RIM.y, away));
    float thin = smoothstep(0.15, 0.6, change);        // a finger is thinner than its rims: they would be dots
    float even = smoothstep(0.70, 0.97, straight);     // an echo's fingers are a few triangles: splinters
    rim = even * mix(rim, THIN_RIM, thin);
    float glint = clamp(dot(n, normalize(lamp + to_eye)), 0.0, 1.0);
    for (int i = 0; i < 5; i++) glint *= glint;  // its 32nd power
    glint *= even * (1.0 - thin);
    vec3 glass = figure_colour * (0.05 + rim) + light_colour * 0.6 * glint;
#ifdef LED
    vec3 ember = held_colour * (0.04 + 0.13 * facing + rim) + light_colour * 0.4 * glint;  // threads are brighter
#else
    vec3 ember = held_colour * (0.28 + 0.25 * facing + rim);
#endif
    colour = vec4(brightness * mix(glass, ember, mark), hides);
}
