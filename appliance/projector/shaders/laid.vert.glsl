// A part of the picture, laid onto the wall: its box, or with FRAME what is around it. The perspective is the
// vertices' w, so that pixels need no division.
uniform mat3 clip_from_picture;
uniform vec4 box;  // left, lower, right, upper
out vec2 uv;

void main() {
#ifdef FRAME
    int corner = gl_VertexID / 2 % 4;
    bool outer = gl_VertexID % 2 == 1;
#else
    int corner = gl_VertexID < 2 ? gl_VertexID : 5 - gl_VertexID;
    const bool outer = false;
#endif
    vec2 share = vec2(corner == 1 || corner == 2, corner > 1);
    uv = outer ? share : mix(box.xy, box.zw, share);
    vec3 at = clip_from_picture * vec3(uv, 1.0);
    gl_Position = vec4(at.xy, 0.0, at.z);
}
