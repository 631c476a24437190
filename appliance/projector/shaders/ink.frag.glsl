// How much ink lies where the body is: little where it turns to the eye, more along its outline. Alpha: how much
// of it is the colour of what a hand holds.
in vec3 place;
in vec3 normal;
in vec3 skin;
in float open;
in float mark;
#ifdef BRUSH
in float pressed;  // a lifted brush leaves bristles with paper between them
#endif
uniform vec3 eye;
uniform float level;
uniform float hollow;
uniform sampler2D noise;
out vec4 colour;
#ifdef BRUSH
#include ink_head
#endif

void main() {
    vec3 n = normalize(normal);
    float facing = clamp(dot(n, normalize(eye - place)), 0.0, 1.0);
    float wash = texture(noise, skin.xy * 1.3 + skin.z).r;
    float outline = (1.0 - facing) * sqrt(1.0 - facing);
    float full = mix(1.0, 0.66 + 0.45 * outline + 0.35 * (wash - 0.5) + 0.25 * (1.0 - open), hollow);
#ifdef BRUSH
    vec2 hairs = abs(skin.x) > 0.12 ? vec2(0.5 * skin.x, 5.0 * skin.y + 3.0 * skin.z) : vec2(0.5 * skin.y, 5.0 * skin.x + 3.0 * skin.z);
    full *= mix(0.62 + 0.78 * smoothstep(0.35, 0.65, texture(noise, hairs).b), 1.0, pressed);
    vec3 from_head = skin - head_at;
    if (head_drawn > 0.0 && dot(from_head, from_head) < HEAD_REACH * HEAD_REACH) {
        vec3 at = head_axes * from_head;
        full = mix(full, head_ink(at, n, outline), head_drawn * smoothstep(-0.082, -0.062, at.y));
    }
#endif
    colour = vec4(vec3(level * full), mark * level * full);
}
