// The body's surface in the pose of one row.
#include skin
#include melt
#include held
in vec3 in_position;
in vec4 in_normal;  // w: how much light comes near
in vec4 in_sunk;
in vec4 in_calm;
in uvec4 in_joints;
in vec4 in_weights;
uniform mat4 projection;
uniform int row;
out vec3 place;
out vec3 normal;
out vec3 skin;
out float open;
out float mark;
#ifdef BRUSH
uniform highp sampler2D led;  // how hard the brush is pressed at each joint
uniform highp sampler2D brush_ways;  // three rows: how far a place is along the joint's limb, and to two sides
uniform float swell;
out float pressed;
out vec4 drawn;
#endif

void main() {
    mat2x4 by = blended(in_joints, in_weights, row);
    float without_face = smoothstep(0.0, 0.25, melt);
    place = moved(by, in_position + without_face * in_sunk.xyz);
    normal = turned(by, mix(2.0 * in_normal.xyz - 1.0, 2.0 * in_calm.xyz - 1.0, without_face));
    melt_body(place, normal, row);
    float molten = smoothstep(0.25, 0.70, melt);  // the folds of a molten surface meet, and must look alike
    skin = mix(in_position, place - vec3(melt_root.x, 0.0, melt_root.z), molten);
#ifdef BRUSH
    pressed = 0.0;
    drawn = vec4(0.0);
    for (int i = 0; i < 4; i++) {
        ivec2 joint = ivec2(int(in_joints[i]), 0);
        pressed += in_weights[i] * texelFetch(led, joint, 0).r;
        mat3x4 way = mat3x4(texelFetch(brush_ways, joint, 0), texelFetch(brush_ways, joint + ivec2(0, 1), 0), texelFetch(brush_ways, joint + ivec2(0, 2), 0));
        drawn += in_weights[i] * vec4(vec4(in_position, 1.0) * way, in_weights[i]);
    }
    drawn.xyz = mix(drawn.xyz, skin.yxz, molten);
    place += normal * swell * (max(pressed, 0.25) - 0.4);  // fingers and toes stay whole
#endif
    mark = held_at(in_joints, in_weights, in_position);
    open = mix(2.0 * in_normal.w - 1.0, 1.0, molten);
    gl_Position = projection * vec4(place, 1.0);
}
