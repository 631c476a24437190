// Plaster in stage light: a warm key with a soft shadow, a cool rim, light that the floor gives back.
in vec3 place;
in vec3 normal;
in vec3 skin;
in float open;
in float mark;
uniform vec3 eye;
uniform vec3 lamp;
uniform vec3 back_lamp;
uniform vec3 figure_colour;
uniform vec3 light_colour;
uniform vec3 accent_colour;
uniform vec3 held_colour;
uniform float shadow;
uniform float exposure;
uniform float melt;  // the folds of a molten surface throw no shadows onto each other
uniform mat4 lamp_projection;
uniform sampler2D lamp_depth;
uniform sampler2D noise;
out vec4 colour;
#include tone

float lit(vec3 n) {
    vec3 at = (lamp_projection * vec4(place + (0.010 + 0.05 * melt) * n, 1.0)).xyz * 0.5 + 0.5;
    float turn = 6.2832 * grain(gl_FragCoord.xy), sum = 0.0;
    for (int i = 0; i < 8; i++) {
        float angle = turn + 2.399963 * float(i);
        vec2 around = sqrt((float(i) + 0.5) / 8.0) * vec2(cos(angle), sin(angle));
        vec3 bytes = texture(lamp_depth, at.xy + 0.008 * around).rgb;
        sum += step(at.z - 0.004, dot(bytes, vec3(1.0, 1.0 / 255.0, 1.0 / 65025.0)));
    }
    return sum / 8.0;
}

void main() {
    vec3 n = normalize(normal), to_eye = normalize(eye - place);
    vec4 rough = texture(noise, skin.xy * 1.9 + skin.z * 1.3) + texture(noise, skin.zy * 4.3 - skin.x) - 1.0;
    float straight = dot(n, lamp), shaded = pow(clamp((straight + 0.06) / 1.06, 0.0, 1.0), 1.3) * mix(1.0, lit(n), shadow);
    n = normalize(n + 0.17 * rough.rgr);
    float facing = clamp(dot(n, to_eye), 0.0, 1.0);
    vec3 albedo = mix(figure_colour, held_colour, mark) * (0.90 + 0.24 * rough.g);
    float key = min(shaded, 1.0) * clamp(0.35 + 0.65 * dot(n, lamp) / max(straight, 0.2), 0.4, 1.3);
    float cavity = mix(1.0, open * open, 0.9), grounded = mix(1.0, smoothstep(-0.03, 0.16, place.y), 0.75 * melt);
    float sky = 0.5 + 0.5 * n.y;
    vec3 bounce = light_colour * 0.16 * (1.0 - sky) * exp(-2.5 * place.y);
    vec3 ambient = (mix(vec3(0.006), accent_colour * 0.028, sky) + bounce) * cavity;
    float behind = clamp(dot(n, back_lamp) * 0.9 + 0.1, 0.0, 1.0);
    vec3 rim = accent_colour * (0.10 * behind + 4.5 * behind * pow(1.0 - facing, 3.0)) * cavity;
    float warm = shaded * (1.0 - shaded);
    vec3 glance = vec3(0.10, 0.03, 0.0) * warm;
    float sheen = 0.07 * pow(clamp(dot(n, normalize(lamp + to_eye)), 0.0, 1.0), 14.0) * shaded;
    float aimed = mix(1.4, 3.1, smoothstep(0.35, 0.95, place.y));  // at the head: a stop more than on the legs
    vec3 light = albedo * (light_colour * (key * aimed * mix(1.0, open, 0.35)) + glance + ambient + rim) + light_colour * sheen;
    light += held_colour * mark * (0.16 + 0.30 * facing) * cavity;
    colour = vec4(dithered(toned(exposure * grounded * light), gl_FragCoord.xy), 1.0);
}
