// How firmly a hand holds what moves a vertex; `held` 0 switches the mark off. LED: how far it follows, which changes
// along a bone from the joint where it begins to the one where it ends.
uniform float held;
#ifdef LED
uniform highp sampler2D led;
uniform highp sampler2D bones;  // two rows: how far a place of the rest pose is along each joint's bone; where it ends
#else
uniform highp sampler2D holds;
#endif

float held_of(int joint, vec3 place) {
#ifdef LED
    float along = clamp(dot(texelFetch(bones, ivec2(joint, 0), 0), vec4(place, 1.0)), 0.0, 1.0);
    int end = int(texelFetch(bones, ivec2(joint, 1), 0).r);
    return mix(texelFetch(led, ivec2(joint, 0), 0).r, texelFetch(led, ivec2(end, 0), 0).r, along);
#else
    return texelFetch(holds, ivec2(joint, 0), 0).r;
#endif
}

float held_at(uvec4 joints, vec4 weights, vec3 place) {
    if (held == 0.0) return 0.0;
    float sum = 0.0;
    for (int i = 0; i < 4; i++) {
        if (weights[i] > 0.0) sum += weights[i] * held_of(int(joints[i]), place);
    }
    return held * sum;
}
