// Light in the dark: what was drawn, in the air that it lights.
in vec2 uv;
uniform sampler2D picture;
uniform sampler2D air;
uniform float aspect;
uniform float exposure;
uniform float opacity;
out vec4 colour;
#include tone
#include edges

void main() {
    vec3 drawn = texture(picture, uv).rgb, around = texture(air, uv).rgb;
    vec3 light = 4.0 * drawn * drawn + around * around;
    colour = vec4(dithered(toned(exposure * light) * edge(uv, aspect), gl_FragCoord.xy), opacity);
}
