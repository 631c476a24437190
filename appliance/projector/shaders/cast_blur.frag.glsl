// One direction of three blurs at once: narrow for red, wider for green, widest for blue.
in vec2 uv;
uniform sampler2D source;
uniform vec2 step_uv;
out vec4 colour;

void main() {
    vec3 sum = vec3(0.0), weights = vec3(0.0);
    for (int i = -6; i <= 6; i++) {
        float x = float(i);
        vec3 weight = exp(-x * x / vec3(0.9, 7.0, 26.0));
        sum += weight * texture(source, uv + x * step_uv).rgb;
        weights += weight;
    }
    colour = vec4(sum / weights, 1.0);
}
