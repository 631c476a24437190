// A smaller copy; gain lifts faint light above the steps of eight bits.
in vec2 uv;
uniform sampler2D source;
uniform vec2 texel;
uniform float gain;
out vec4 colour;

void main() {
    vec4 sum = texture(source, uv + texel * vec2(-1.0, -1.0)) + texture(source, uv + texel * vec2(1.0, -1.0))
             + texture(source, uv + texel * vec2(-1.0, 1.0)) + texture(source, uv + texel * vec2(1.0, 1.0));
    colour = 0.25 * gain * sum;
}
