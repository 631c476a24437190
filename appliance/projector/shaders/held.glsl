// How firmly a hand holds what moves a vertex; `held` 0 switches the mark off.
#ifdef LED
#define holds led
#endif
uniform highp sampler2D holds;
uniform float held;

float held_at(uvec4 joints, vec4 weights) {
    if (held == 0.0) return 0.0;
    float sum = 0.0;
    for (int i = 0; i < 4; i++) {
        if (weights[i] > 0.0) sum += weights[i] * texelFetch(holds, ivec2(int(joints[i]), 0), 0).r;
    }
    return held * sum;
}
