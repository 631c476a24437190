// The picture's four corners on the wall: its perspective is the vertices' w, so that pixels need no division.
// With MARKS one triangle that covers the display: text and rings may be outside of the picture.

#ifdef MARKS
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
#else
uniform mat3 clip_from_part;       // unit square of this display's part (y down) to clip space
out vec2 uv;

void main() {
    uv = vec2(gl_VertexID % 2, gl_VertexID / 2);
    vec3 at = clip_from_part * vec3(uv, 1.0);
    gl_Position = vec4(at.xy, 0.0, at.z);
}
#endif
