// How dark the masks make each pixel of the display.
in vec2 uv;
uniform sampler2D dark;   // top row first
uniform vec2 flips;
uniform float strength;
out vec4 colour;

void main() {
    vec2 wall = vec2(uv.x, 1.0 - uv.y);
    colour = vec4(0.0, 0.0, 0.0, strength * texture(dark, mix(wall, 1.0 - wall, flips)).r);
}
