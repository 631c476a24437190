// A head as a brush draws it, in places from its middle (figure heights: to the front, upwards, to the side): hair
// in one sweep from the forehead to the nape, brows, eyes, the shadow under the jaw, and on the face thin ink. Light
// ink on a dark ground draws what is lit: the face, and less of everything that dark ink would draw.
uniform vec3 head_at;
uniform mat3 head_axes;
uniform float head_drawn;  // 0: no person's head, or it has melted
const float HEAD_REACH = 0.09;

float stroke(vec2 at, vec2 from, vec2 to, vec2 widths) {
    vec2 way = to - from;
    float along = clamp(dot(at - from, way) / dot(way, way), 0.0, 1.0), wide = mix(widths.x, widths.y, along);
    return 1.0 - smoothstep(0.5 * wide, 1.1 * wide, length(at - from - along * way));
}

float head_ink(vec3 at, vec3 n, float body) {
    float side = abs(at.z), front = step(0.015, at.x), wide = mix(0.7, 1.15, pressed);
    float bristle = texture(noise, vec2(0.5 * (at.y - at.x) + 0.37, 5.0 * at.z + 0.21)).b;
    float hair = smoothstep(-0.003, 0.003, dot(at.xy - vec2(0.043, 0.034), vec2(-0.72, 0.69)) + 0.014 * (bristle - 0.5));
    float under = 1.0 - smoothstep(-0.006, 0.004, dot(at.xy - vec2(-0.008, -0.034), vec2(0.588, 0.809)));
    float nose = (1.0 - smoothstep(0.012, 0.024, side)) * smoothstep(0.036, 0.046, at.x);
    float shade = 1.0 - smoothstep(-0.40, 0.25, dot(n, lamp));
    float brow = stroke(vec2(side, at.y), vec2(0.011, 0.002), vec2(0.036, 0.0035), wide * vec2(0.0050, 0.0018));
    float lid = 1.0 - smoothstep(0.0025, 0.0060, length(vec2(0.5, 1.0) * (vec2(side, at.y) - vec2(0.020, -0.0105))));
    float strand = smoothstep(0.34, 0.52, bristle);
    if (is_light) {
        float mouth = stroke(vec2(side, at.y), vec2(0.0, -0.043), vec2(0.013, -0.0415), vec2(0.0050, 0.0020));
        float left_out = max(0.9 * under, front * max(max(0.45 * brow, 0.30 * lid), 0.6 * mouth));
        return mix(max(body, 0.30 + 0.30 * (1.0 - shade)), body * (0.15 + 0.6 * strand), hair) * (1.0 - left_out);
    }
    float drawn = max(0.70 * shade * (1.0 - 0.7 * nose), front * max(0.85 * brow, 0.40 * lid));
    drawn = max(drawn, max(under, hair * max(mix(0.78, 1.0, strand), 0.25 + shade)));
    return mix(0.12, 1.0, drawn);
}
