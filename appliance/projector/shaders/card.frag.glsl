// A card over the dance, or two that cross-fade; colours are multiplied by their alpha until the end.
in vec2 uv;
uniform sampler2D content;
uniform sampler2D content_before;
uniform vec4 place;  // left, lower, right, upper
uniform vec4 place_before;
uniform vec4 ground;
uniform vec4 ground_before;
uniform float share;
#include wall

vec4 on_ground(sampler2D drawn, vec4 box, vec4 below) {
    vec2 at = (uv - box.xy) / (box.zw - box.xy), inside = step(vec2(0.0), at) * step(at, vec2(1.0));
    vec4 here = inside.x * inside.y * texture(drawn, at);
    return here + (1.0 - here.a) * below;
}

void main() {
    vec4 card = mix(on_ground(content_before, place_before, ground_before), on_ground(content, place, ground), share);
    show(card.rgb / max(card.a, 0.001));
    colour.a = card.a;
}
