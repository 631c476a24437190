// The same everywhere: what a sheet of strokes loses as it dries.
uniform vec4 loss;
out vec4 colour;

void main() {
    colour = loss;
}
