// A grain of the cloud: on the body, or on its way off it since it was left behind by a movement.
#include skin
#include melt
#include held
in vec3 in_position;
in vec4 in_normal;
in vec4 in_chance;
in uvec4 in_joints;
in vec4 in_weights;
uniform mat4 projection;
uniform vec3 eye;
uniform vec3 lamp;
uniform float pixels;
uniform float rows;
uniform float row_s;
uniform float time;
uniform float time_round;  // seconds after which time begins anew
uniform float loose_share;
uniform float fog;
uniform float focus;
uniform sampler2D noise;
uniform vec3 figure_colour;
uniform vec3 light_colour;
uniform vec3 accent_colour;
uniform vec3 held_colour;
out vec4 grain_colour;

vec3 place_at(float back) {
    int row = int(back);
    vec3 newer = moved(blended(in_joints, in_weights, row), in_position);
    vec3 older = moved(joint_at(in_joints.x, row + 1), in_position);
    vec3 same = moved(joint_at(in_joints.x, row), in_position);
    return newer + (older - same) * fract(back);
}

void main() {
    bool loose = in_chance.x < loose_share;
    float life = (rows - 3.0) * (0.35 + 0.65 * in_chance.y);
    float lives = round(time_round / (life * row_s));  // whole ones, so that no grain jumps then
    float back = loose ? fract(time / time_round * lives + in_chance.z) * life : 0.0;
    int row = int(back);
    vec3 place = place_at(back), before = place_at(back + 1.5);
    vec3 velocity = (place - before) / (1.5 * row_s);
    float age = back / life, age_s = back * row_s, speed = length(velocity);
    vec3 normal = turned(joint_at(in_joints.x, row), 2.0 * in_normal.xyz - 1.0);
    place += 0.3 * melt * (in_chance.zwy - 0.5);  // else molten grains gather where the mass draws together
    melt_body(place, normal, row);
    vec3 drift = textureLod(noise, place.xy * 0.9 + in_chance.zw * 0.15 + time * 0.01, 0.0).rgb
               + textureLod(noise, place.zy * 1.7 - time * 0.013, 0.0).gbr - 1.0;
    float light_one = 1.0 - 0.6 * pow(in_chance.y, 10.0);  // large grains fall, small ones are carried away
    place += age_s * light_one * ((0.30 + 0.25 * in_chance.w) * velocity * (1.0 - 0.45 * age) + (0.14 + 0.26 * speed) * drift + 0.04 * normal);
    place.y -= 0.5 * age_s * age_s * (1.0 - light_one);
    place += normal * 0.006 * (in_chance.w - 0.3);
    vec3 way = eye - place;
    float distance = length(way), facing = dot(normal, way) / distance;
    float key = clamp(dot(normal, lamp) * 0.85 + 0.15, 0.0, 1.0);
    float rim = pow(1.0 - clamp(abs(facing), 0.0, 1.0), 2.5);
    float deep = exp(-fog * 1.6 * max(distance - focus, -0.3));
    float spark = 0.45 + 0.5 * in_chance.w + 1.4 * pow(in_chance.y, 12.0);
    vec3 on_body = figure_colour * (0.05 + 0.95 * key * key) + accent_colour * (0.16 + 1.2 * rim);
    vec3 in_air = mix(light_colour, accent_colour, smoothstep(0.1, 0.8, age));
    float mark = held_at(in_joints, in_weights, in_position);
    on_body = mix(on_body, held_colour * (0.7 + 0.5 * key + 0.5 * rim), mark);
    in_air = mix(in_air, held_colour, mark * (1.0 - age));
    float shown = loose ? smoothstep(0.30, 1.5, speed) * pow(1.0 - age, 1.5) : smoothstep(-0.1, 0.3, facing);
    grain_colour = vec4((loose ? in_air * 1.3 : on_body) * spark * shown * deep, 1.0);
    gl_Position = projection * vec4(place + 0.012 * way / distance, 1.0);
    float size = pixels * in_normal.w * (0.36 + 0.45 * in_chance.w + 1.6 * pow(in_chance.y, 9.0)) / gl_Position.w;
    gl_PointSize = clamp(size, 1.6, 16.0);
    grain_colour.rgb *= min(1.0, size * size / (1.6 * 1.6));
    if (shown < 0.01) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
}
