// Light in the dark: what was drawn, its glow near and far, haze, and a floor that catches some of it.
in vec2 uv;
in vec3 ray;
uniform sampler2D picture;
uniform sampler2D near_glow;
uniform sampler2D far_glow;
uniform sampler2D noise;
uniform vec3 eye;
uniform vec2 ground;
uniform vec3 air_colour;
uniform float aspect;
uniform float fog;
uniform float glow;
uniform float exposure;
uniform float time;
uniform float opacity;
out vec4 colour;
#include tone
#include edges

void main() {
    vec3 drawn = texture(picture, uv).rgb;
    vec3 light = drawn * drawn * 4.0;
    vec3 near = texture(near_glow, uv).rgb, far = texture(far_glow, uv).rgb;
    light += glow * (1.6 * near * near + 2.2 * far * far);
    vec2 p = vec2(uv.x * aspect, uv.y);
    float haze = texture(noise, p * 0.35 + vec2(-0.004, 0.003) * time).r;
    float on_floor = 0.0;
    if (ray.y < -1e-3) {
        vec2 off = (eye - ray * (eye.y / ray.y)).xz - ground;
        on_floor = exp(-dot(off, off) / 0.9);
    }
    light += fog * (0.5 + haze) * (air_colour * (0.5 * on_floor + 0.25 * exp(-4.0 * dot(p - vec2(0.5 * aspect, 0.45), p - vec2(0.5 * aspect, 0.45)))) + far * 0.12);
    colour = vec4(dithered(toned(exposure * light) * edge(uv, aspect), gl_FragCoord.xy), opacity);
}
