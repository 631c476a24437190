// One moment of several while the shutter is open.
in vec2 uv;
uniform sampler2D source;
uniform float part;
out vec4 colour;

void main() {
    colour = part * texture(source, uv);
}
