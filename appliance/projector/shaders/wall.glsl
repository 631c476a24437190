// What a look shows, as bright as the wall wants it.
uniform float level;
uniform float opacity;
#ifdef GAMMA
uniform float inverse_gamma;
#endif
out vec4 colour;
#include tone

void show(vec3 shown) {
#ifdef GAMMA
    shown = pow(max(shown, 0.0), vec3(inverse_gamma));
#endif
    colour = vec4(dithered(level * shown, gl_FragCoord.xy), opacity);
}
