// Smooths the figure's outline: where neighbours differ, colours are averaged along the edge (after FXAA).
vec4 smoothed(sampler2D source, vec2 at, vec2 size) {
    const vec4 weigh = vec4(0.30, 0.59, 0.11, 0.6);
    vec4 here = texture(source, at);
    float nw = dot(texture(source, at + size * vec2(-1.0, 1.0)), weigh);
    float ne = dot(texture(source, at + size), weigh);
    float sw = dot(texture(source, at - size), weigh);
    float se = dot(texture(source, at + size * vec2(1.0, -1.0)), weigh);
    float middle = dot(here, weigh);
    float low = min(middle, min(min(nw, ne), min(sw, se))), high = max(middle, max(max(nw, ne), max(sw, se)));
    if (high - low < 0.05 * high + 0.01) return here;
    vec2 along = vec2(sw + se - nw - ne, nw + sw - ne - se);
    along = clamp(along / (min(abs(along.x), abs(along.y)) + 0.03 * (nw + ne + sw + se) + 0.004), -6.0, 6.0) * size;
    vec4 close = 0.5 * (texture(source, at - along / 6.0) + texture(source, at + along / 6.0));
    vec4 wide = 0.5 * close + 0.25 * (texture(source, at - 0.5 * along) + texture(source, at + 0.5 * along));
    float seen = dot(wide, weigh);
    return seen < low || seen > high ? close : wide;
}
