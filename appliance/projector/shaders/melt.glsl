// From a human to an amorphous body: `melt` 0 is the body as it is, 1 a mass that draws together and flows, and whose
// surface swims. Needs skin. The mass is what is near to bones: distances to all of them flow into each other (the
// logarithm of a sum of exponentials, the further the more molten), and places go to where that distance is nothing.
// Without MELT no look of the show melts, and it costs nothing.
#ifdef MELT
const int MELT_BONES = 15;
uniform float melt;
uniform float melt_time;
uniform int melt_steps;  // towards the surface; 0: as it is
uniform int melt_bones;
uniform vec3 bind_root;
uniform vec4 melt_from[MELT_BONES];  // one end; radius
uniform vec4 melt_way[MELT_BONES];   // from there to the other; 1 / its square
uniform vec3 melt_root;              // where the root is with these bones
uniform vec3 melt_gather;            // what is left of distances from it
const vec2 MELT_FLOW = vec2(0.012, 0.060);  // figure heights in which bones flow into each other: human, and molten
const vec2 MELT_FOOT = vec2(0.07, 0.08);    // how much wider the mass is on the floor, and up to where
const float MELT_OVERLAP = 0.06;  // legs that grow into each other close the slit between them
const float MELT_WAVE = 0.020;

// Distance from the mass, and the way along which it grows.
vec4 mass(vec3 place, float flow) {
    float sharp = 1.4427 / flow;  // exp2 is what a GPU has
    vec4 sum = vec4(0.0, 0.0, 0.0, 1e-20);
    for (int i = 0; i < melt_bones; i++) {
        vec4 way = melt_way[i];
        vec3 off = place - melt_from[i].xyz;
        off -= clamp(dot(off, way.xyz) * way.w, 0.0, 1.0) * way.xyz;
        float square = max(dot(off, off), 1e-8), per = inversesqrt(square), part = exp2((melt_from[i].w - square * per) * sharp);
        sum += vec4((part * per) * off, part);
    }
    return vec4(sum.xyz / sum.w, -log2(sum.w) / sharp);
}

void melt_body(inout vec3 place, inout vec3 normal, int row) {
    if (melt <= 0.0) return;
    vec3 root = moved(joint_at(0u, row), bind_root), apart = vec3(root.x - melt_root.x, 0.0, root.z - melt_root.z);
    vec3 floor_root = vec3(melt_root.x, 0.0, melt_root.z);
    place = floor_root + melt_gather * (place - apart - floor_root);
    vec3 skin_out = normalize(normal / melt_gather), flown = place + MELT_OVERLAP * melt * skin_out;
    float flow = mix(MELT_FLOW.x, MELT_FLOW.y, melt);
    vec4 near;
    for (int i = 0; i < melt_steps; i++) {
        near = mass(vec3(flown.x, max(flown.y, MELT_FOOT.y * melt), flown.z), flow);  // it narrows no more to the floor
        float off = near.w - MELT_FOOT.x * melt * exp(-max(flown.y, 0.0) / MELT_FOOT.y);
        flown -= clamp(off / max(dot(near.xyz, near.xyz), 0.3), -0.15, 0.15) * near.xyz;
    }
    float share = smoothstep(0.0, 0.55, melt);
    place = mix(place, flown, share);
    normal = normalize(mix(skin_out, normalize(near.xyz + 1e-5 * skin_out), share));
    vec3 phase = vec3(13.0, 17.0, 11.0) * place.yzx + vec3(7.0, 5.0, 9.0) * place.zxy + melt_time * vec3(0.9, 0.7, 1.1);
    vec3 waves = sin(phase), slopes = cos(phase);
    vec3 gradient = vec3(11.0 * slopes.z + 5.0 * slopes.y, 13.0 * slopes.x + 9.0 * slopes.z, 17.0 * slopes.y + 7.0 * slopes.x);
    float size = melt * MELT_WAVE;
    place += size * (waves.x + waves.y + waves.z) * normal + apart;
    normal = normalize(normal - size * (gradient - dot(gradient, normal) * normal));
    place.y = 0.5 * (place.y + sqrt(place.y * place.y + 0.0004 * melt));  // the floor, met in a curve
}
#else
const float melt = 0.0;
const vec3 melt_root = vec3(0.0);

void melt_body(inout vec3 place, inout vec3 normal, int row) {}
#endif
