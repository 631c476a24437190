// Ink on paper: edges that the fibres pull, darker where it dried last; echoes are washed out. Colours are as
// the eye sees them, not light: thin ink darkens paper evenly. With FRAME blank paper.
in vec2 uv;
uniform sampler2D picture;
uniform sampler2D wet_picture;
uniform sampler2D paper;
uniform sampler2D noise;
uniform float aspect;
uniform sampler2D kept;  // the evening's strokes: wet ones, and stains
uniform vec2 reach;
uniform vec3 figure_colour;
uniform vec3 light_colour;
uniform vec3 accent_colour;
uniform vec3 air_colour;
uniform vec3 held_colour;
uniform float fog;
uniform float dry;  // 1: a fast limb is the mean of several moments, and its brush runs dry there
uniform vec2 texel;
uniform bool is_light;  // chalk: it does not spread, and catches on the grain
#include wall
#include ink_drawn

// A mean of the pixels around: in a coarser picture an outline is steps, which would be drawn as such.
vec4 soft(vec2 at) {
    vec2 aside = texel * vec2(0.65, 0.5);
    return 0.5 * (texture(picture, at + aside) + texture(picture, at - aside));
}

void main() {
    vec4 sheet = texture(paper, uv);
    float rough = sheet.b - 0.5;
#ifdef BACKDROP
    vec3 paper_colour = air_colour * image_behind(uv);
#else
    vec3 paper_colour = air_colour;
#endif
    vec3 blank = paper_colour * (0.95 + 0.10 * (sheet.r - 0.5) + 0.08 * rough);
    vec2 at = uv + (sheet.rg - 0.5) * reach, old = texture(kept, at).rg * (0.85 + 0.6 * rough);
    blank = mix(blank, mix(accent_colour, blank, 0.3), old.g);
    vec3 shown = mix(blank, accent_colour, old.r);
#ifndef FRAME
    vec4 wet = texture(wet_picture, at);
    if (wet.r + wet.g + wet.b > 0.004) {
        vec4 ink = soft(at);
        vec4 tooth = texture(noise, vec2(uv.x * aspect, uv.y) * 2.6);
        float drinks = is_light ? 0.0 : fog * 2.0 * smoothstep(0.50, 0.66, tooth.r);
        float full = 0.2 * wet.r + 0.8 * ink.r + 0.12 * (tooth.g - 0.5);
        float edge = max(0.06, 0.7 * fwidth(full));
        float body = smoothstep(0.26 - edge, 0.26 + edge, full);
        float dried = 1.0 - smoothstep(0.45, 0.8, wet.r);
        float laid = (ink.r / max(body, 0.4) - DRAWN) / (1.0 - DRAWN), catches = 0.6 * tooth.a + 0.4 * tooth.g;
        float covers = is_light ? 1.7 * (1.45 * laid - catches) : laid + 0.15 * dried + 0.25 * (tooth.g - 0.5);
        covers = body * clamp(covers, 0.0, 1.0);
        float bristles = smoothstep(0.30, 0.62, tooth.g);
        covers = max(covers, dry * (1.0 - body) * smoothstep(0.03, 0.40, ink.r) * bristles * 0.85);
        float echo = smoothstep(0.02, 0.7, 0.55 * wet.g + 0.45 * ink.g) * (is_light ? smoothstep(0.45, 0.85, 1.0 - catches) : 0.68 + 0.6 * (tooth.g - 0.5));
        float stroke = ink.b * (0.85 + 0.6 * rough) * (1.0 - 0.6 * covers);
        shown = mix(shown, light_colour, fog * (is_light ? smoothstep(0.4, 0.8, 1.0 - catches) : 0.35 + 0.8 * drinks) * wet.r * (1.0 - body));
        shown = mix(shown, mix(light_colour, blank, 0.35), clamp(echo, 0.0, 1.0) * (1.0 - body));  // thin ink shows paper, not the echo
        shown = mix(shown, accent_colour, clamp(max(stroke - old.r, 0.0), 0.0, 1.0));
        float mark = clamp((wet.a + ink.a) / max(wet.r + ink.r, 0.01), 0.0, 1.0);
        shown = mix(shown, mix(figure_colour, held_colour, mark), covers);
    }
#endif
    show(sheet.a * min(shown, 1.0));
}
