// A strand: two vertices for each of its points, as wide as the eye needs it.
#include skin
#include held
in vec3 in_position;
in vec4 in_tangent;
in vec4 in_normal;
in vec4 in_along;  // side -1 or 1, strength 0..1, a chance
in uvec4 in_joints;
in vec4 in_weights;
uniform mat4 projection;
uniform vec3 eye;
uniform vec2 pixel;
uniform float width;
uniform int row;
uniform float floor_side;
uniform float time;
out float across;
out float strength;
out float facing;
out float pulse;
out float mark;

void main() {
    mat2x4 by = blended(in_joints, in_weights, row);
    vec3 place = moved(by, in_position), tangent = turned(by, 2.0 * in_tangent.xyz - 1.0);
    vec3 way = normalize(eye - place);
    facing = dot(turned(by, 2.0 * in_normal.xyz - 1.0), way);
    strength = in_along.y * (floor_side < 0.0 ? exp(-5.0 * max(place.y, 0.0)) : 1.0);
    pulse = in_along.z * 7.0 + place.y * 0.9 - time * 0.22;
    mark = held_at(in_joints, in_weights, in_position);
    place.y *= floor_side;
    tangent.y *= floor_side;
    vec4 here = projection * vec4(place, 1.0), there = projection * vec4(place + 0.01 * tangent, 1.0);
    vec2 along = (there.xy / there.w - here.xy / here.w) / pixel;
    vec2 side = normalize(vec2(-along.y, along.x) + 1e-6);
    across = in_along.x;
    here.xy += in_along.x * side * width * pixel * here.w;
    gl_Position = here;
}
