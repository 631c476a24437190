// The plaster figure, its outline smoothed, before the air around it; with FRAME only the air.
in vec2 uv;
uniform sampler2D picture;
uniform sampler2D air;
uniform vec2 texel;
#include wall
#include smooth

void main() {
    vec4 around = texture(air, uv);
    around.rgb = before_image(around.rgb, uv);
#ifdef FRAME
    show(around.a * around.rgb);
#else
    vec4 front = smoothed(picture, uv, texel);
    show(around.a * (around.rgb * (1.0 - front.a) + front.rgb));
#endif
}
