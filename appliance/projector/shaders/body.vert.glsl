// The body's surface in the pose of one row.
#include skin
in vec3 in_position;
in vec3 in_normal;
in float in_open;
in uvec4 in_joints;
in vec4 in_weights;
uniform mat4 projection;
uniform int row;
out vec3 place;
out vec3 normal;
out vec3 skin;
out float open;

void main() {
    mat2x4 by = blended(in_joints, in_weights, row);
    place = moved(by, in_position);
    normal = turned(by, in_normal);
    skin = in_position;
    open = in_open;
    gl_Position = projection * vec4(place, 1.0);
}
