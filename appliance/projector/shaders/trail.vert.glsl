// The way of one point of the body through the last second, as a ribbon: one instance a point, two vertices a row.
#include skin
in vec3 in_position;
in vec4 in_chance;
in uvec4 in_joints;
in vec4 in_weights;
uniform mat4 projection;
uniform vec2 pixel;
uniform float width;
uniform float rows;
uniform float row_s;
uniform float floor_side;
uniform float pressure;  // 1: a fast brush is lifted, and strokes end in a point
out float across;
out float age;
out float speed;
out float chance;

vec3 at(int row) {
    vec3 place = moved(joint_at(in_joints.x, row), in_position);
    return vec3(place.x, place.y * floor_side, place.z);
}

void main() {
    int row = gl_VertexID / 2, last = int(rows) - 1;
    across = float(gl_VertexID % 2) * 2.0 - 1.0;
    int newer = max(row - 1, 0), older = min(row + 1, last);
    vec3 here_at = at(row), newer_at = at(newer), older_at = at(older);
    speed = length(newer_at - older_at) / (float(older - newer) * row_s);
    age = float(row) / float(last);
    chance = in_chance.x;
    vec4 here = projection * vec4(here_at, 1.0);
    vec4 a = projection * vec4(newer_at, 1.0), b = projection * vec4(older_at, 1.0);
    vec2 along = (a.xy / a.w - b.xy / b.w) / pixel;
    vec2 side = normalize(vec2(-along.y, along.x) + 1e-5);
    float pressed = mix(1.6, 0.5, smoothstep(0.6, 3.5, speed)) * sqrt(1.0 - age) * smoothstep(0.0, 0.12, age + 0.04);
    here.xy += across * side * width * mix(sqrt(1.0 - 0.8 * age), pressed, pressure) * pixel * here.w;
    gl_Position = here;
}
