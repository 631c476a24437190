// A soft grain of light.
in vec4 grain_colour;
out vec4 colour;

void main() {
    vec2 off = 2.0 * gl_PointCoord - 1.0;
    colour = vec4(grain_colour.rgb * max(0.0, 1.0 - dot(off, off)), 1.0);
}
