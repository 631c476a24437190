// The body, flattened along the light onto the floor.
#include skin
#include melt
in vec3 in_position;
in vec4 in_normal;
in uvec4 in_joints;
in vec4 in_weights;
uniform vec3 lamp;
uniform vec2 middle;
uniform float reach;
out float height;

void main() {
    mat2x4 by = blended(in_joints, in_weights, 0);
    vec3 place = moved(by, in_position), normal = turned(by, 2.0 * in_normal.xyz - 1.0);
    melt_body(place, normal, 0);
    vec2 fallen = place.xz - lamp.xz * (place.y / lamp.y);
    height = place.y;
    gl_Position = vec4((fallen - middle) / reach, 0.0, 1.0);
}
