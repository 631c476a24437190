// The picture onto the wall: corner-pin, mirror; GAMMA, BLEND for edge blend, DIM for brightness, MARKS.
// WARP: the picture is pulled by a mesh, and each pixel of the wall looks for its place in it.
// EDGES: the light that the blended edge leaves of a picture that is on the display already.

uniform sampler2D picture;         // what the looks have drawn; with edge blend wider than this display
uniform vec4 part;                 // where this part begins in the picture, and its size; y down
#ifdef DIM
uniform float scale;               // brightness * level
uniform vec2 seed;                 // another pattern of dither for each picture

#endif

out vec4 colour;

#ifdef GAMMA
uniform float inverse_gamma;
#endif

#ifdef BLEND
uniform vec4 blend;                // the way to the other part, y down; overlap, a share of this part; 1 / gamma

// Both ramps of an overlap add up to one in linear light.
float blended(vec2 uv) {
    float from_edge = clamp((0.5 - dot(uv - 0.5, blend.xy)) / blend.z, 0.0, 1.0);
    return pow(smoothstep(0.0, 1.0, from_edge), blend.w);
}
#endif

#ifdef MARKS
uniform vec2 display;              // width, height, pixels
uniform vec2 flips;                // 1: exchange left and right; 1: exchange top and bottom
uniform mat3 picture_from_wall;    // wall pixels (y down) to the unit square of this display's part
uniform sampler2D text;            // 1: a letter, 0.5: the ground under it, 0: neither; top row first
uniform float grid;                // 0 or 1
uniform vec3 marker;               // the chosen corner, wall pixels; radius, 0: none
uniform float text_scale;          // wall pixels a text pixel
uniform float aspect;              // width over height of the whole picture

#ifdef WARP
uniform sampler2D offsets;         // over the picture's unit square, shares of the display; the square of FINE points

vec2 pulled(vec2 uv) {
    float points = float(textureSize(offsets, 0).x);
    return textureLod(offsets, (clamp(uv, 0.0, 1.0) * (points - 1.0) + 0.5) / points, 0.0).rg * display;
}
#endif

float lines(vec2 place, vec2 pixel_size) {
    vec2 nearest = abs(fract(place - 0.5) - 0.5) / pixel_size;
    return 1.0 - clamp(min(nearest.x, nearest.y) - 0.5, 0.0, 1.0);
}

float grid_lines(vec2 place, vec2 pixel_size) {
    vec2 cells = vec2(16.0, 9.0);
    float upright = lines(place * cells, pixel_size * cells);
    vec2 diagonals = vec2(place.x - place.y, place.x + place.y);
    float radius = length((place - 0.5) * vec2(aspect, 1.0));
    float off_circle = abs(radius - 3.5 / 9.0) / max(fwidth(radius), 1e-9);  // it touches two of the lines
    upright = max(upright, 1.0 - clamp(off_circle - 0.5, 0.0, 1.0));
    return max(upright, lines(diagonals, vec2(pixel_size.x + pixel_size.y)));
}

float coverage(vec2 uv, vec2 pixel_size) {
    vec2 inside = min(uv, 1.0 - uv) / pixel_size;
    return clamp(min(inside.x, inside.y) + 0.5, 0.0, 1.0);
}
#else
in vec2 uv;
#endif

#ifdef DIM
float noise(vec2 place) {
    return fract(52.9829189 * fract(dot(place + seed, vec2(0.06711056, 0.00583715)))) - 0.5;
}
#endif

void main() {
#ifdef MARKS
    vec2 wall = vec2(gl_FragCoord.x, display.y - gl_FragCoord.y);
    wall = mix(wall, display - wall, flips);
    vec3 projected = picture_from_wall * vec3(wall, 1.0);
    vec2 uv = projected.xy / projected.z;
#ifdef WARP
    for (int step = 0; step < 8; step++) {
        projected = picture_from_wall * vec3(wall - pulled(uv), 1.0);
        uv = projected.xy / projected.z;
    }
#endif
    vec2 pixel_size = max(fwidth(uv), 1e-9);
    float seen = projected.z > 0.0 ? coverage(uv, pixel_size) : 0.0;
#ifdef EDGES
    colour = vec4(vec3(seen * blended(uv)), 1.0);
    return;
#endif
    vec2 inside = clamp(uv, 0.0, 1.0);
#else
    vec2 inside = uv;
#endif
    vec2 place = part.xy + inside * part.zw;
    vec3 light = textureLod(picture, vec2(place.x, 1.0 - place.y), 0.0).rgb;
#ifdef GAMMA
    light = pow(light, vec3(inverse_gamma));
#endif
#ifdef BLEND
    light *= blended(uv);
#endif
#ifdef MARKS
    light *= seen;
#endif
#ifdef DIM
    light *= scale;
    light += noise(gl_FragCoord.xy) / 255.0 * step(0.5 / 255.0, light);
#endif
#ifdef MARKS
    light *= 1.0 - 0.65 * grid;  // else its lines are lost on paper
    light = mix(light, vec3(0.9), grid * seen * grid_lines(part.xy + uv * part.zw, pixel_size * part.zw));
    float ring = abs(distance(wall, marker.xy) - marker.z);
    if (marker.z > 0.0) light = mix(light, vec3(1.0, 0.6, 0.1), 1.0 - clamp(ring - 2.0, 0.0, 1.0));
    float ink = texelFetch(text, ivec2(wall / text_scale), 0).r;
    if (ink > 0.25) light = ink > 0.75 ? vec3(1.0) : 0.3 * light;
#endif
    colour = vec4(light, 1.0);
}
