// One direction of a soft blur: nine samples, each between two pixels.
in vec2 uv;
uniform sampler2D source;
uniform vec2 step_uv;
out vec4 colour;

void main() {
    vec4 sum = 0.1964826 * texture(source, uv);
    sum += 0.2969069 * (texture(source, uv + 1.4117647 * step_uv) + texture(source, uv - 1.4117647 * step_uv));
    sum += 0.0944704 * (texture(source, uv + 3.2941176 * step_uv) + texture(source, uv - 3.2941176 * step_uv));
    sum += 0.0103814 * (texture(source, uv + 5.1764706 * step_uv) + texture(source, uv - 5.1764706 * step_uv));
    colour = sum;
}
