// How much ink there is where the body is. BRUSH: the figure itself, drawn with the side of a brush along its limbs:
// wet in the shade, dry in the light, where the bristles leave paper between them. Light ink is chalk: it draws what
// is lit, and contours. It begins at DRAWN: less is no body. Alpha: its share in the colour of what a hand holds.
in vec3 place;
in vec3 normal;
in vec3 skin;
in float open;
in float mark;
#ifdef BRUSH
in float pressed;  // a lifted brush leaves bristles with paper between them
in vec4 drawn;    // along its limb, to two sides of the axis; 1: of one limb, less: between limbs
uniform vec3 lamp;
uniform bool is_light;
uniform float pixel_height;  // figure heights that a pixel takes
#endif
uniform vec3 eye;
uniform float level;
uniform sampler2D noise;
out vec4 colour;
#ifdef BRUSH
#include ink_head
#include ink_drawn
#endif

void main() {
#ifdef BRUSH
    vec3 n = normalize(normal);
    float facing = clamp(dot(n, normalize(eye - place)), 0.0, 1.0), sunlit = dot(n, lamp);
    vec2 stroke_at = vec2(0.9 * drawn.x, atan(drawn.z, drawn.y) / 3.14159);  // twice the texture around a limb
    float hair = textureLod(noise, stroke_at, 1.0).b - 0.5, load = textureLod(noise, stroke_at, 5.0).b - 0.5;
    float bristle = 0.5 + mix(0.3, 1.0, smoothstep(0.45, 0.9, drawn.w)) * (hair - (is_light ? 0.6 : 0.25) * load);
    float full, contour = 0.0;
    if (is_light) {
        float lit = smoothstep(-0.25, 0.95, sunlit), wide = mix(0.003, 0.009, smoothstep(0.3, 0.7, bristle));
        float away = facing / (fwidth(facing) + 1e-4) * pixel_height;  // from the outline
        contour = (1.0 - smoothstep(wide, 1.6 * wide + pixel_height, away)) * (1.0 - smoothstep(0.45, 0.65, facing));
        full = smoothstep(-0.16, 0.16, bristle - mix(0.66, 0.30, lit * mix(0.8, 1.0, pressed))) * (0.22 + 0.55 * lit) * open;
    } else {
        float shade = 1.0 - smoothstep(-0.45, 0.80, sunlit), outline = (1.0 - facing) * sqrt(1.0 - facing);
        float dryness = mix(0.66, 0.54, pressed) - 0.52 * shade;
        float wet = smoothstep(dryness - 0.10, dryness + 0.10, bristle), wash = texture(noise, 1.3 * skin.xy + skin.z).r;
        full = mix(0.34 * wash, mix(0.80, 1.0, shade), wet) + 0.45 * outline + 0.25 * (1.0 - open);
    }
    vec3 from_head = skin - head_at;
    if (head_drawn > 0.0 && dot(from_head, from_head) < HEAD_REACH * HEAD_REACH) {
        vec3 at = head_axes * from_head;
        full = mix(full, head_ink(at, n, full), head_drawn * smoothstep(-0.082, -0.062, at.y));
    }
    full = mix(DRAWN, 1.0, clamp(max(full, contour), 0.0, 1.0));
#else
    float full = 1.0;
#endif
    colour = vec4(vec3(level * full), mark * level * full);
}
