// Light in the dark, in the air of the room: its glow near and far, haze, a floor that mirrors and catches some of it.
in vec2 uv;
in vec3 ray;
uniform sampler2D near_glow;
uniform sampler2D far_glow;
uniform sampler2D noise;
uniform vec3 eye;
uniform vec2 ground;
uniform vec2 stands[4];
uniform vec2 heart;
uniform sampler2D floor_shadow;
uniform vec2 middle;
uniform float reach;
uniform float spread;
uniform vec3 figure_light;
uniform float mirror;
uniform mat3 axes;
uniform vec2 slopes;
uniform vec3 air_colour;
uniform float aspect;
uniform float fog;
uniform float glow;
uniform float time;
uniform float exposure;
out vec4 colour;
#include tone
#include edges

// The figure that stands the nearest to this ray.
vec2 nearest_stand() {
    vec2 ahead = normalize(ray.xz), found = stands[0];
    float least = 1e9;
    for (int i = 0; i < 4; i++) {
        vec2 way = stands[i] - eye.xz;
        float aside = abs(way.x * ahead.y - way.y * ahead.x);
        if (aside < least) {
            least = aside;
            found = stands[i];
        }
    }
    return found;
}

// That figure, taken for a picture that stands upright before the eye, on a dull floor: it dims with height.
vec3 mirrored(vec3 at) {
    vec3 up = vec3(ray.x, -ray.y, ray.z);
    vec2 stand = nearest_stand(), ahead = normalize(stand - eye.xz);
    float way = dot(stand - at.xz, ahead) / dot(up.xz, ahead);
    vec3 met = at + way * up, seen = (met - eye) * axes;
    vec2 spot = 0.5 - 0.5 * seen.xy / (seen.z * slopes);
    bool misses = way < 0.0 || any(lessThan(spot, vec2(0.0))) || any(greaterThan(spot, vec2(1.0)));
    vec3 there = texture(near_glow, spot).rgb;
    return misses ? vec3(0.0) : there * there * exp(-2.4 * met.y);
}

// Light that the figure throws straight down: sharp below a foot, wide and faint below what is high.
float lit_below(vec2 at) {
    vec2 on_cast = (at - middle) / reach;
    vec3 bands = texture(floor_shadow, 0.5 + 0.5 * on_cast).rgb;
    float inside = 1.0 - smoothstep(0.75, 1.0, max(abs(on_cast.x), abs(on_cast.y)));
    return inside * (0.9 * bands.r + 0.35 * bands.g + 0.2 * bands.b);
}

void main() {
    vec3 near = texture(near_glow, uv).rgb, far = 0.5 * texture(far_glow, uv).rgb;
    vec2 p = vec2(uv.x * aspect, uv.y), off_heart = (p - heart) / vec2(spread, 1.0);
    float haze = 0.4 + 1.2 * texture(noise, p * 0.33 + vec2(-0.004, 0.003) * time).r;
    float on_floor = 0.0;
    vec3 reflected = vec3(0.0);
    if (ray.y < -1e-3) {
        vec3 at = eye - ray * (eye.y / ray.y);
        float worn = 0.7 + 0.6 * texture(noise, at.xz * 0.4).r;
        reflected = worn * (2.5 * mirror * mirrored(at) + 0.38 * figure_light * lit_below(at.xz));
        vec2 off = (at.xz - ground) / spread;
        on_floor = exp(-dot(off, off) * 2.4);
    }
    vec3 light = reflected + glow * (1.6 * near * near + 2.6 * far * far);
    float lit = fall(uv);
    light += fog * haze * (lit * lit * air_colour * (1.5 * on_floor + 0.9 * exp(-7.0 * dot(off_heart, off_heart))) + 0.22 * far * far);
    float speck = texelFetch(noise, ivec2(gl_FragCoord.xy) & 255, 0).a;
    colour = vec4(deep(toned(exposure * light), speck), edge(uv, aspect));
}
