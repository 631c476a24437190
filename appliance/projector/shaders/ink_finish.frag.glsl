// Ink on paper: edges that the fibres pull, darker where it dried last; echoes are washed out. Colours are as
// the eye sees them, not light: thin ink darkens paper evenly.
in vec2 uv;
uniform sampler2D picture;
uniform sampler2D near_glow;
uniform sampler2D noise;
uniform vec3 figure_colour;
uniform vec3 light_colour;
uniform vec3 accent_colour;
uniform vec3 air_colour;
uniform vec2 foot;
uniform float foot_size;
uniform float aspect;
uniform float fog;
uniform float shadow;
uniform float density;
uniform float exposure;
uniform float opacity;
out vec4 colour;
#include tone
#include edges

void main() {
    vec2 p = vec2(uv.x * aspect, uv.y);
    vec4 soft = texture(noise, p * 0.7), fine = texture(noise, p * 3.1);
    vec2 pull = (soft.rg - 0.5) * 0.010 + (fine.rg - 0.5) * 0.006 * (0.4 + density);
    vec2 at = uv + pull * vec2(1.0 / aspect, 1.0);
    vec3 ink = texture(picture, at).rgb, wet = texture(near_glow, at).rgb;
    float rough = (fine.b - 0.5) * (0.25 + 0.5 * density) + (soft.g - 0.5) * 0.3;

    float body = smoothstep(0.30, 0.42, 0.6 * wet.r + 0.4 * ink.r + 0.25 * rough);
    float dried = body * (1.0 - smoothstep(0.45, 0.8, wet.r));
    float tone = body * clamp(ink.r * 1.0 + 0.15 * dried + 0.40 * rough + 0.04, 0.0, 1.0);
    float echo = smoothstep(0.02, 0.7, 0.55 * wet.g + 0.45 * ink.g) * (0.8 + 0.9 * rough);
    float stroke = ink.b * (0.85 + 0.6 * rough);

    vec2 down = (p - foot) / foot_size;
    float pool = exp(-dot(down * vec2(1.0, 5.5), down * vec2(1.0, 5.5))) * (0.5 + 1.1 * (soft.b - 0.2));
    float bleed = texture(near_glow, uv + pull * 4.0).r;

    vec3 paper = air_colour * (0.95 + 0.10 * (soft.r - 0.5) + 0.07 * (fine.b - 0.5));
    vec3 shown = mix(paper, light_colour, clamp(0.35 * shadow * pool, 0.0, 1.0));
    shown = mix(shown, light_colour, clamp(fog * 0.35 * bleed * (1.0 - body), 0.0, 1.0));
    shown = mix(shown, mix(light_colour, paper, 0.35), clamp(0.85 * echo, 0.0, 1.0));
    shown = mix(shown, accent_colour, clamp(stroke * (1.0 - 0.6 * tone), 0.0, 1.0));
    shown = mix(shown, figure_colour, clamp(tone, 0.0, 1.0));

    float torn = edge(clamp(uv + (soft.rg - 0.5) * 0.05, 0.0, 1.0), aspect);
    float sheet = smoothstep(0.0, 0.85, torn + (0.12 * (fine.b - 0.5) + 0.10 * (fine.g - 0.5)) * (1.0 - torn)) * min(1.0, 3.0 * edge(uv, aspect));
    colour = vec4(dithered(max(exposure * shown, 0.0) * sheet, gl_FragCoord.xy), opacity);
}
