// A sheet of paper, made once: how its fibres pull the ink (red, green), how rough it is (blue), and where it
// ends (alpha): a deckle edge in slow waves, before it the light of the beam falls off.
in vec2 uv;
uniform sampler2D noise;
uniform float aspect;
uniform float density;
out vec4 colour;
#include edges

void main() {
    vec2 p = vec2(uv.x * aspect, uv.y);
    vec4 soft = texture(noise, p * 0.7), fine = texture(noise, p * 3.1);
    vec2 pull = 0.62 * (soft.rg - 0.5) + 0.38 * (0.4 + density) * (fine.rg - 0.5);
    float rough = (fine.b - 0.5) * (0.25 + 0.5 * density) + (soft.g - 0.5) * 0.3;
    float torn = edge(clamp(uv + (soft.rg - 0.5) * 0.016 + (fine.rg - 0.5) * 0.003, 0.0, 1.0), aspect);
    float cut = smoothstep(-1.2, 1.2, (torn - 0.30) / max(fwidth(torn), 1e-4));
    float sheet = cut * mix(0.72, 1.0, smoothstep(0.2, 1.0, edge(uv, aspect))) * min(1.0, 3.0 * edge(uv, aspect));
    colour = vec4(0.5 + pull, 0.5 + rough, sheet);
}
