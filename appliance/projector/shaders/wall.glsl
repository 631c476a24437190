// The picture of a look, as bright as the wall wants it.
uniform float level;
uniform float opacity;
#ifdef GAMMA
uniform float inverse_gamma;
#endif
#ifdef BACKDROP
uniform sampler2D backdrop;
uniform vec2 cut;  // how much of the image's width and height is seen
#endif
out vec4 colour;
#include tone

vec3 image_behind(vec2 at) {
#ifdef BACKDROP
    return texture(backdrop, 0.5 + (at - 0.5) * cut).rgb;
#else
    return vec3(0.0);
#endif
}

// Light before the image behind the figure: neither takes the other's place.
vec3 before_image(vec3 light, vec2 at) {
    vec3 image = image_behind(at);
    return image + light - image * min(light, 1.0);
}

void show(vec3 shown) {
#ifdef GAMMA
    shown = pow(max(shown, 0.0), vec3(inverse_gamma));
#endif
    colour = vec4(dithered(level * shown, gl_FragCoord.xy), opacity);
}
