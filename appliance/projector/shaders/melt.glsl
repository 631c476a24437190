// From a human to an amorphous body: `melt` 0 is the body as it is, 1 a lump around its root whose surface swims.
// Needs skin. Radially: r comes near to R from both sides; then along the normal by waves that pass through space.
uniform float melt;
uniform float melt_time;
uniform vec3 bind_root;
const vec3 MELT_SHAPE = vec3(1.0, 0.75, 1.0);  // the lump is taller than wide
const float MELT_RADIUS = 0.27;
const float MELT_SINK = 0.17;   // figure heights: it lies on the floor
const float MELT_SWELL = 0.03;  // limbs grow into each other
const float MELT_FATTEN = 0.09;  // the further a part has come, the fatter: arms do not thin out, fingers close
const float MELT_WAVE = 0.030;

void melt_body(inout vec3 place, inout vec3 normal, int row) {
    if (melt <= 0.0) return;
    vec3 root = moved(joint_at(0u, row), bind_root), q = (place - root) * MELT_SHAPE;
    float r = max(length(q), 1e-4), x = r / MELT_RADIUS, t = tanh(x);
    float radial = mix(1.0, (0.5 + 0.5 * t) / x, melt), along = mix(1.0, 0.5 * (1.0 - t * t) + 0.15, melt);
    vec3 out_of = q / r, bent = normal / MELT_SHAPE, skin_out = normal;
    float outward = dot(bent, out_of);
    bent = (bent - outward * out_of) / radial + outward * out_of / along;
    normal = normalize(mix(normalize(bent * MELT_SHAPE), normalize(out_of * MELT_SHAPE), 0.6 * melt * (2.0 - melt)));
    q *= radial;
    vec3 phase = vec3(13.0, 17.0, 11.0) * q.yzx + vec3(7.0, 5.0, 9.0) * q.zxy + melt_time * vec3(0.9, 0.7, 1.1);
    vec3 waves = sin(phase), slopes = cos(phase);
    vec3 gradient = vec3(11.0 * slopes.z + 5.0 * slopes.y, 13.0 * slopes.x + 9.0 * slopes.z, 17.0 * slopes.y + 7.0 * slopes.x);
    float size = melt * MELT_WAVE;
    place = root + q / MELT_SHAPE + melt * ((MELT_SWELL + MELT_FATTEN * (1.0 - min(radial, 1.0))) * skin_out - vec3(0.0, MELT_SINK, 0.0));
    place += size * (waves.x + waves.y + waves.z) * normalize(out_of / MELT_SHAPE);
    normal = normalize(normal - size * (gradient - dot(gradient, normal) * normal));
    place.y = max(place.y, 0.004 * melt);
}
