// The body follows its joints: dual quaternions w, x, y, z from the pose texture, blended (Kavan et al. 2007).
uniform highp sampler2D poses;
uniform float back;  // how far on the way to the row before, 0 to 1: a moment while the shutter is open

mat2x4 joint_at(uint joint, int row) {
    int column = 2 * int(joint);
    mat2x4 now = mat2x4(texelFetch(poses, ivec2(column, row), 0), texelFetch(poses, ivec2(column + 1, row), 0));
    if (back == 0.0) return now;
    mat2x4 then = mat2x4(texelFetch(poses, ivec2(column, row + 1), 0), texelFetch(poses, ivec2(column + 1, row + 1), 0));
    return (1.0 - back) * now + (dot(now[0], then[0]) < 0.0 ? -back : back) * then;
}

mat2x4 blended(uvec4 joints, vec4 weights, int row) {
    mat2x4 first = joint_at(joints.x, row);
    mat2x4 sum = weights.x * first;
    for (int i = 1; i < 4; i++) {
        if (weights[i] > 0.0) {
            mat2x4 other = joint_at(joints[i], row);
            sum += (dot(first[0], other[0]) < 0.0 ? -weights[i] : weights[i]) * other;
        }
    }
    return sum / length(sum[0]);
}

vec3 turned(mat2x4 by, vec3 v) {
    return v + 2.0 * cross(by[0].yzw, cross(by[0].yzw, v) + by[0].x * v);
}

vec3 moved(mat2x4 by, vec3 p) {
    vec4 r = by[0], d = by[1];
    return turned(by, p) + 2.0 * (r.x * d.yzw - d.x * r.yzw + cross(r.yzw, d.yzw));
}
