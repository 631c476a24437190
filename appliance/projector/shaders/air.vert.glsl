// One triangle that covers the picture, and for each pixel the way on which the eye looks through it.
uniform mat3 axes;
uniform vec2 slopes;
out vec2 uv;
out vec3 ray;

void main() {
    uv = vec2(gl_VertexID == 1 ? 2.0 : 0.0, gl_VertexID == 2 ? 2.0 : 0.0);
    gl_Position = vec4(2.0 * uv - 1.0, 0.0, 1.0);
    ray = axes * vec3((2.0 * uv - 1.0) * slopes, -1.0);
}
