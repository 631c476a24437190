// The plaster figure, its outline smoothed, before the air around it.
in vec2 uv;
uniform sampler2D picture;
uniform sampler2D air;
uniform vec2 texel;
uniform vec4 box;
uniform float opacity;
out vec4 colour;
#include tone
#include smooth

void main() {
    vec4 around = texture(air, uv);
    vec3 shown = around.rgb;
    if (uv.x > box.x && uv.y > box.y && uv.x < box.z && uv.y < box.w) {
        vec4 front = smoothed(picture, uv, texel);
        shown = shown * (1.0 - front.a) + front.rgb;
    }
    colour = vec4(dithered(shown * around.a, gl_FragCoord.xy), opacity);
}
