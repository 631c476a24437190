// What light in the dark leaves in the room: its glow near and far, haze, a floor that catches some of it.
in vec2 uv;
in vec3 ray;
uniform sampler2D near_glow;
uniform sampler2D far_glow;
uniform sampler2D noise;
uniform vec3 eye;
uniform vec2 ground;
uniform vec2 heart;
uniform vec3 air_colour;
uniform float aspect;
uniform float fog;
uniform float glow;
uniform float time;
uniform float exposure;
out vec4 colour;
#include tone
#include edges

void main() {
    vec3 near = texture(near_glow, uv).rgb, far = 0.5 * texture(far_glow, uv).rgb;
    vec2 p = vec2(uv.x * aspect, uv.y), off_heart = p - heart;
    float haze = 0.4 + 1.2 * texture(noise, p * 0.33 + vec2(-0.004, 0.003) * time).r;
    float on_floor = 0.0;
    if (ray.y < -1e-3) {
        vec2 off = (eye - ray * (eye.y / ray.y)).xz - ground;
        on_floor = exp(-dot(off, off) * 2.4);
    }
    vec3 light = glow * (1.6 * near * near + 2.6 * far * far);
    light += fog * haze * (air_colour * (1.5 * on_floor + 0.9 * exp(-7.0 * dot(off_heart, off_heart))) + 0.22 * far * far);
    float speck = texelFetch(noise, ivec2(gl_FragCoord.xy) & 255, 0).a;
    colour = vec4(toned(exposure * light) + (speck - 0.5) / 255.0, edge(uv, aspect));
}
