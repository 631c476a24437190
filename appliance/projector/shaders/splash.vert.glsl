// Drops that a sudden move throws: DROPS instances an accent, four vertices each; in the picture's plane.
uniform mat4 projection;
uniform vec2 pixel;
uniform vec4 splash_at[MOST];   // place; strength, 0: none
uniform vec4 splash_way[MOST];  // velocity before the accent, figure heights a second; seed
uniform float splash_age[MOST]; // seconds
uniform float height;           // pixels that a figure height takes
uniform float lasts;            // seconds until a splash has faded
out vec2 spot;
out float fresh;
out float chance;

float random(uint n) {
    n = (n ^ 61u) ^ (n >> 16);
    n *= 9u;
    n ^= n >> 4;
    n *= 0x27d4eb2du;
    return float((n ^ (n >> 15)) & 0xffffu) / 65535.0;
}

void main() {
    int one = gl_InstanceID / DROPS;
    uint seed = uint(splash_way[one].w) * 131u + uint(gl_InstanceID % DROPS) * 7919u;
    float strength = splash_at[one].w, age = splash_age[one], far = random(seed), aside = random(seed + 1u);
    vec4 from = projection * vec4(splash_at[one].xyz, 1.0);
    vec4 ahead = projection * vec4(splash_at[one].xyz + 0.05 * splash_way[one].xyz, 1.0);
    vec2 way = (ahead.xy / ahead.w - from.xy / from.w) / pixel;
    vec2 along = normalize(way + 1e-4), side = vec2(-along.y, along.x);
    float flown = (1.0 - exp(-age / 0.05)) * strength * height * (0.02 + 0.30 * far * far);
    float size = height * strength * (0.004 + 0.024 * pow(random(seed + 2u), 3.0)) * (1.2 - 0.7 * far);
    float angle = 1.5 * (aside - 0.5) * (1.2 - 0.6 * far);
    vec2 flies = cos(angle) * along + sin(angle) * side;
    spot = vec2(float(gl_VertexID % 2), float(gl_VertexID / 2)) * 2.0 - 1.0;
    vec2 shape = spot.x * (1.0 + 1.6 * far) * flies + spot.y * vec2(-flies.y, flies.x);
    fresh = strength <= 0.0 ? 0.0 : 1.0 - smoothstep(0.4, 1.0, age / lasts);
    chance = aside;
    gl_Position = vec4(from.xy / from.w + (flown * flies + size * shape) * pixel, 0.0, fresh > 0.0 ? 1.0 : 0.0);
}
