// Light in the dark: what was drawn, in the air that it lights; neither takes the other's place.
in vec2 uv;
uniform sampler2D picture;
uniform sampler2D air;
uniform float exposure;
#include wall

void main() {
    vec3 drawn = min((2.0 * exposure) * texture(picture, uv).rgb, 1.0);
    vec4 around = texture(air, uv);
    vec3 shown = before_image(drawn + around.rgb - drawn * around.rgb, uv) * around.a;
    show(shown);
}
