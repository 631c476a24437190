// The body, flattened along the light onto the floor.
#include skin
in vec3 in_position;
in uvec4 in_joints;
in vec4 in_weights;
uniform vec3 lamp;
uniform vec2 middle;
uniform float reach;
out float height;

void main() {
    vec3 place = moved(blended(in_joints, in_weights, 0), in_position);
    vec2 fallen = place.xz - lamp.xz * (place.y / lamp.y);
    height = place.y;
    gl_Position = vec4((fallen - middle) / reach, 0.0, 1.0);
}
