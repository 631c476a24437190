// A string from the hand, or from above, to a joint: taut where the joint follows, slack where it does not. One
// instance a string, two vertices a step. BETWEEN: from the same joint of another figure, and only where both answer.
#include skin
in vec3 in_position;
in vec4 in_chance;
in uvec4 in_joints;
uniform mat4 projection;
uniform vec2 pixel;
uniform float width;
uniform float time;
uniform float steps;
uniform int leader;  // -1: no hand
uniform vec3 leader_at;
uniform vec3 above;
uniform highp sampler2D led;
#ifdef BETWEEN
uniform highp sampler2D others;  // the poses of the other figure
#endif
out float across;
out float along;
out float follows;
out float chance;

vec3 at(float t, vec3 from, vec3 to, float slack) {
    float bow = 4.0 * t * (1.0 - t), far = length(to - from);
    vec3 aside = normalize(cross(to - from, vec3(0.0, 1.0, 0.001)) + 1e-5);
    float sway = sin(6.2832 * (0.11 * time + in_chance.y + 0.7 * t)) * slack;
    float beat = sin(6.2832 * (2.0 * t - 3.0 * time + in_chance.z)) * follows * 0.004;
    return mix(from, to, t) - vec3(0.0, (0.30 + 0.25 * in_chance.x) * far * slack * bow, 0.0)
         + aside * bow * (0.05 * sway + beat + 0.02 * (in_chance.w - 0.5));
}

void main() {
    float t = float(gl_VertexID / 2) / steps;
    across = float(gl_VertexID % 2) * 2.0 - 1.0;
    along = t;
    chance = in_chance.x;
    follows = texelFetch(led, ivec2(int(in_joints.x), 0), 0).r;
    vec3 to = moved(joint_at(in_joints.x, 0), in_position);
    vec3 from = above + 0.25 * vec3(to.x - above.x, 0.0, to.z - above.z);
    if (leader >= 0) from = moved(joint_at(uint(leader), 0), leader_at);
    float slack = (1.0 - follows) * (1.0 - follows) * (leader >= 0 ? 1.0 : 0.12), wide = 0.6 + 0.9 * follows;
#ifdef BETWEEN
    int column = 2 * int(in_joints.x);
    from = moved(mat2x4(texelFetch(others, ivec2(column, 0), 0), texelFetch(others, ivec2(column + 1, 0), 0)), in_position);
    slack = 0.5 * (1.0 - follows);
    wide = 1.5 * smoothstep(0.05, 0.4, follows);
#endif
    vec3 place = at(t, from, to, slack), next = at(t + 0.02, from, to, slack);
    vec4 here = projection * vec4(place, 1.0), there = projection * vec4(next, 1.0);
    vec2 way = (there.xy / there.w - here.xy / here.w) / pixel;
    vec2 side = normalize(vec2(-way.y, way.x) + 1e-6);
    here.xy += across * side * width * wide * pixel * here.w;
    gl_Position = here;
}
