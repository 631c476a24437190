// A drop: round, with an edge that the paper frays.
in vec2 spot;
in float fresh;
in float chance;
uniform float brightness;
uniform sampler2D noise;
out vec4 colour;

void main() {
    float frayed = 0.5 * (texture(noise, 0.3 * spot + chance).r - 0.5);
    colour = vec4(brightness * fresh * (1.0 - smoothstep(0.6, 0.95, length(spot) + frayed)));
}
