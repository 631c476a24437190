// A thread to a joint from the control, which is above the picture: taut where the joint follows the hand, slack where
// it does not. One instance a thread, two vertices a step; the first leads to the held joint itself. BETWEEN: from the
// same joint of another figure, and only where both answer.
#include skin
in vec3 in_position;
in vec4 in_chance;
in uvec4 in_joints;
uniform mat4 projection;
uniform mat3 axes;
uniform vec3 eye;
uniform vec2 pixel;
uniform float width;
uniform float time;
uniform float steps;
uniform int leader;  // -1: no hand
uniform vec3 leader_at;
uniform vec3 control;
uniform vec3 glints_from;  // a lamp near by: its glint is where a thread reflects it to the eye
uniform highp sampler2D led;
#ifdef BETWEEN
uniform highp sampler2D others;  // the poses of the other figure
#endif
out float across;
out float along;
out float follows;
out float chance;
out float glint;
out float is_held;
const float BAR = 0.3;  // how far threads are apart at the control: a share of how far apart they end

vec3 at(float t, vec3 from, vec3 to, float slack) {
    float far = length(to - from), bow = 6.75 * t * t * (1.0 - t);
    float sway = sin(6.2832 * (0.11 * time + in_chance.y + 0.4 * t));
    float aside = slack * ((in_chance.x - 0.5) * 0.30 + 0.03 * sway) + 0.004 * (in_chance.w - 0.5);
    return mix(from, to, t) + far * bow * (aside * axes[0] - vec3(0.0, 0.16 * slack, 0.0));
}

void main() {
    float t = float(gl_VertexID / 2) / steps;
    across = float(gl_VertexID % 2) * 2.0 - 1.0;
    along = t;
    chance = in_chance.x;
    bool first = gl_InstanceID == 0 && leader >= 0;
    uint joint = first ? uint(leader) : in_joints.x;
    is_held = first ? 1.0 : 0.0;
    follows = texelFetch(led, ivec2(int(joint), 0), 0).r;
    vec3 to = moved(joint_at(joint, 0), first ? leader_at : in_position);
    vec3 from = control + BAR * dot(to - control, axes[0]) * axes[0];
    float slack = (1.0 - follows) * (1.0 - follows) * (leader >= 0 ? 1.0 : 0.12), wide = 0.8 + 0.4 * follows + 0.4 * is_held;
#ifdef BETWEEN
    int column = 2 * int(in_joints.x);
    from = moved(mat2x4(texelFetch(others, ivec2(column, 0), 0), texelFetch(others, ivec2(column + 1, 0), 0)), in_position);
    slack = 0.5 * (1.0 - follows);
    wide = 1.2 * smoothstep(0.05, 0.4, follows);
#endif
    vec3 place = at(t, from, to, slack), next = at(t + 0.02, from, to, slack);
    vec3 halfway = normalize(normalize(glints_from - place) + normalize(eye - place));
    float tilt = dot(normalize(next - place), halfway);
    glint = exp(-160.0 * tilt * tilt);
    vec4 here = projection * vec4(place, 1.0), there = projection * vec4(next, 1.0);
    vec2 way = (there.xy / there.w - here.xy / here.w) / pixel;
    vec2 side = normalize(vec2(-way.y, way.x) + 1e-6);
    here.xy += across * side * width * wide * pixel * here.w;
    gl_Position = here;
}
