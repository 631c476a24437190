// The empty stage around the plaster figure: a pool of light on the floor, its shadow, haze in the beam.
in vec2 uv;
in vec3 ray;
uniform sampler2D floor_shadow;
uniform sampler2D contact;
uniform vec2 contact_middle;
uniform sampler2D noise;
uniform vec3 eye;
uniform vec2 pool_at;
uniform vec3 lamp;
uniform vec2 middle;
uniform float reach;
uniform float spread;
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
out vec4 colour;
#include tone
#include edges

vec3 floor_light() {
    if (ray.y > -1e-3) return vec3(0.0);
    vec3 at = eye - ray * (eye.y / ray.y);
    vec2 off = (at.xz - pool_at) / spread, away = normalize(lamp.xz);
    off -= 0.45 * dot(off, away) * away;  // the lamp's cone on the floor is longer than wide
    float far = length(off), pool = 1.25 * (1.0 - smoothstep(0.12, 0.68, far)) + 0.12 * exp(-2.5 * far * far);
    vec2 on_cast = (at.xz - middle) / reach;
    vec3 bands = texture(floor_shadow, 0.5 + 0.5 * on_cast).rgb;
    float inside = 1.0 - smoothstep(0.75, 1.0, max(abs(on_cast.x), abs(on_cast.y)));
    float dark = min(1.0, 1.2 * bands.r + 1.15 * bands.g + 1.1 * bands.b) * inside * shadow;
    vec2 on_contact = (at.xz - contact_middle) / reach;
    vec2 above = texture(contact, 0.5 + 0.5 * on_contact).rg * (1.0 - step(1.0, max(abs(on_contact.x), abs(on_contact.y))));
    float worn = 0.62 + 0.5 * texture(noise, at.xz * 0.21).r + 0.30 * (texture(noise, at.xz * 1.1).g - 0.5);
    vec3 bounced = light_colour * (1.0 - dark) + accent_colour * 0.05;
    bounced *= 1.0 - shadow * max(smoothstep(0.08, 0.5, above.r), 0.55 * above.g);
    return air_colour * bounced * pool * worn * 1.3;
}

float beam() {
    vec2 p = vec2(uv.x * aspect, uv.y), axis = beam_to - beam_from;
    float along = dot(p - beam_from, axis) / dot(axis, axis);
    float across = length(p - beam_from - along * axis);
    float width = beam_width * (0.06 + 0.94 * clamp(along, 0.0, 1.3));
    float drift = texture(noise, vec2(p.x * 0.30 - time * 0.006, p.y * 0.22 + time * 0.004)).r;
    float body = exp(-across * across / (width * width)) * smoothstep(1.15, 0.6, along) / (0.25 + along);
    return body * (0.55 + 0.7 * drift);
}

void main() {
    float lit = fall(uv);
    vec3 light = lit * (floor_light() + lit * fog * light_colour * air_colour * 0.42 * beam());
    float speck = texelFetch(noise, ivec2(gl_FragCoord.xy) & 255, 0).a;
    colour = vec4(deep(toned(exposure * light), speck), edge(uv, aspect));
}
