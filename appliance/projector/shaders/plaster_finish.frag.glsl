// The empty stage around the plaster figure: a pool of light on the floor, its shadow, haze in the beam.
in vec2 uv;
in vec3 ray;
uniform sampler2D picture;
uniform sampler2D floor_shadow;
uniform sampler2D noise;
uniform vec2 texel;
uniform vec3 eye;
uniform vec2 ground;
uniform vec2 middle;
uniform float reach;
uniform vec3 light_colour;
uniform vec3 accent_colour;
uniform vec3 air_colour;
uniform vec2 beam_from;
uniform vec2 beam_to;
uniform float beam_width;
uniform float aspect;
uniform float fog;
uniform float shadow;
uniform float exposure;
uniform float time;
uniform float opacity;
out vec4 colour;
#include tone
#include edges
#include smooth

vec3 floor_light() {
    if (ray.y > -1e-3) return vec3(0.0);
    vec3 at = eye - ray * (eye.y / ray.y);
    vec2 off = at.xz - ground;
    float far = dot(off, off);
    float pool = exp(-far / 1.1) + 0.12 * exp(-far / 5.0);
    vec2 on_cast = (at.xz - middle) / reach;
    vec3 bands = texture(floor_shadow, 0.5 + 0.5 * on_cast).rgb;
    float inside = 1.0 - smoothstep(0.8, 1.0, max(abs(on_cast.x), abs(on_cast.y)));
    float dark = min(1.0, bands.r + bands.g + 0.9 * bands.b) * inside * shadow;
    float worn = texture(noise, at.xz * 0.23).r * 0.7 + texture(noise, at.xz * 1.3).g * 0.5 + 0.4;
    return (air_colour * light_colour * pool * (1.0 - dark) * 1.2 + accent_colour * 0.006 * pool) * worn;
}

float beam() {
    vec2 p = vec2(uv.x * aspect, uv.y), from = beam_from, axis = beam_to - beam_from;
    float along = dot(p - from, axis) / dot(axis, axis);
    float across = length(p - from - along * axis);
    float width = beam_width * (0.18 + 0.82 * clamp(along, 0.0, 1.4));
    float drift = texture(noise, vec2(p.x * 0.30 - time * 0.006, p.y * 0.22 + time * 0.004)).r;
    float body = exp(-across * across / (width * width)) * smoothstep(1.5, 0.2, along);
    return body * (0.55 + 0.9 * drift);
}

void main() {
    vec3 light = floor_light() + fog * light_colour * air_colour * 0.55 * beam();
    vec3 back = toned(exposure * light);
    vec4 front = smoothed(picture, uv, texel);
    vec3 shown = (back * (1.0 - front.a) + front.rgb) * edge(uv, aspect);
    colour = vec4(dithered(shown, gl_FragCoord.xy), opacity);
}
