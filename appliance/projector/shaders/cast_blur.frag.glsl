// One direction of three blurs at once: narrow for red, wider for green, widest for blue.
uniform sampler2D source;
uniform vec2 step_uv;  // greater than 0 in the direction
out vec4 colour;

void main() {
    ivec2 along = ivec2(greaterThan(step_uv, vec2(0.0)));
    ivec2 here = ivec2(gl_FragCoord.xy), last = textureSize(source, 0) - 1;
    vec3 sum = vec3(0.0), weights = vec3(0.0);
    for (int i = -6; i <= 6; i++) {
        float x = float(i);
        vec3 weight = exp(-x * x / vec3(0.9, 7.0, 26.0));
        sum += weight * texelFetch(source, clamp(here + i * along, ivec2(0), last), 0).rgb;
        weights += weight;
    }
    colour = vec4(sum / weights, 1.0);
}
