// Smooths the figure's outline: along an edge of coverage the colours are averaged, elsewhere one look is enough.
vec4 smoothed(sampler2D source, vec2 at, vec2 size) {
    vec4 here = texture(source, at);
    vec4 nw = texture(source, at + size * vec2(-0.5, 0.5)), ne = texture(source, at + size * 0.5);
    vec4 sw = texture(source, at - size * 0.5), se = texture(source, at + size * vec2(0.5, -0.5));
    return 0.2 * (here + nw + ne + sw + se);
}
