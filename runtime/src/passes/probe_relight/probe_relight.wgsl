// Probe relight: the light map along the relight rays of four probes, times the SH table (sec. 4.2).
// Dispatch: one workgroup per 4 probes and 256 rays. Twin: reference.rs, probe_relight().
//
// A workgroup fetches the radiance of 64 rays for four probes into workgroup memory, then every invocation adds up one
// SH function of all four: the SH table is read once for four probes, all reads of it are coalesced. Segments of rays
// are added up by sum_segments, in order, so that the result does not depend on scheduling.

override N_SH: u32;
override OCCLUDERS: bool;

const LANES: u32 = 64u;
const PROBES: u32 = 4u;
const RAYS_PER_SEGMENT: u32 = 256u;
const LEVEL_SKY: u32 = 254u;
const LEVEL_BLACK: u32 = 255u;
const MAX_OCCLUDERS: u32 = 64u;
const FARTHEST: f32 = 3.0e38;

struct Params {
    n_probes: u32,
    n_rays: u32,
    n_segments: u32,
    direct_size: u32,
    n_levels: u32,
    has_sky: u32,
    n_occluders: u32,
    // First probe of this page in the arrays of all probes.
    first_probe: u32,
}

// Kinds: 0 sphere (a center, size.x radius), 1 box (a center, size half extents, rotation world to box as a
// quaternion), 2 capsule (a and b ends, size.x radius).
struct Occluder {
    a: vec3f,
    kind: u32,
    b: vec3f,
    bounding_radius: f32,
    size: vec3f,
    pad_0: u32,
    rotation: vec4f,
    radiance: vec3f,
    pad_1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> ray_sh: array<f32>;
@group(0) @binding(2) var<storage, read> ray_uv: array<u32>;
@group(0) @binding(3) var<storage, read> ray_level: array<u32>;
@group(0) @binding(4) var light_map: texture_2d<f32>;
@group(0) @binding(5) var<storage, read> sky_rays: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> partial_sums: array<vec4f>;
@group(0) @binding(7) var<uniform> occluders: array<Occluder, MAX_OCCLUDERS>;
@group(0) @binding(8) var<storage, read> probes: array<vec4f>;
@group(0) @binding(9) var<storage, read> ray_dirs: array<vec4f>;
@group(0) @binding(10) var<storage, read> ray_distance: array<u32>;

// One band each, four probes side by side.
var<workgroup> red: array<vec4f, LANES>;
var<workgroup> green: array<vec4f, LANES>;
var<workgroup> blue: array<vec4f, LANES>;
// Occluders that the probe may see, so that rays test no others.
var<workgroup> near_occluders: array<array<u32, MAX_OCCLUDERS>, PROBES>;
var<workgroup> n_near: array<atomic<u32>, PROBES>;

fn read_light_map(level: u32, packed_uv: u32) -> vec3f {
    let l = min(level, params.n_levels - 1u);
    let size = (params.direct_size + (1u << l) - 1u) >> l;
    let uv = vec2f(f32(packed_uv & 0xffffu), f32(packed_uv >> 16u)) / 65535.0;
    let tap = bilinear_tap(uv, size);
    let a = textureLoad(light_map, tap.lower, l);
    let b = textureLoad(light_map, vec2u(tap.upper.x, tap.lower.y), l);
    let c = textureLoad(light_map, vec2u(tap.lower.x, tap.upper.y), l);
    let d = textureLoad(light_map, tap.upper, l);
    return divide_by_coverage(bilinear(tap, a, b, c, d));
}

// Distance along a unit ray to a sphere; FARTHEST if it misses; 0 from inside.
fn hit_sphere(origin: vec3f, dir: vec3f, center: vec3f, radius: f32) -> f32 {
    let to_center = center - origin;
    let along = dot(to_center, dir);
    let beside = to_center - along * dir;
    let half_chord_2 = radius * radius - dot(beside, beside);
    if (half_chord_2 < 0.0) {
        return FARTHEST;
    }
    let half_chord = sqrt(half_chord_2);
    return select(max(along - half_chord, 0.0), FARTHEST, along + half_chord < 0.0);
}

fn rotate(q: vec4f, v: vec3f) -> vec3f {
    return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v);
}

fn hit_box(origin: vec3f, dir: vec3f, box: Occluder) -> f32 {
    let o = rotate(box.rotation, origin - box.a);
    let d = rotate(box.rotation, dir);
    // A component of 0 gives infinities, which the minima and maxima handle; a zero over zero is kept out.
    let safe = select(d, vec3f(1.0e-30), d == vec3f(0.0));
    let near_planes = (-sign(safe) * box.size - o) / safe;
    let far_planes = (sign(safe) * box.size - o) / safe;
    let near = max(max(near_planes.x, near_planes.y), near_planes.z);
    let far = min(min(far_planes.x, far_planes.y), far_planes.z);
    return select(FARTHEST, max(near, 0.0), near <= far && far >= 0.0);
}

fn hit_capsule(origin: vec3f, dir: vec3f, capsule: Occluder) -> f32 {
    let axis = capsule.b - capsule.a;
    let radius = capsule.size.x;
    var nearest = min(hit_sphere(origin, dir, capsule.a, radius), hit_sphere(origin, dir, capsule.b, radius));
    let length_2 = dot(axis, axis);
    if (length_2 > 0.0) {
        // The tube: the ray and the origin with their parts along the axis removed.
        let from_a = origin - capsule.a;
        let o = from_a - axis * (dot(from_a, axis) / length_2);
        let d = dir - axis * (dot(dir, axis) / length_2);
        let a = dot(d, d);
        let b = dot(o, d);
        let c = dot(o, o) - radius * radius;
        let discriminant = b * b - a * c;
        if (a > 0.0 && discriminant >= 0.0) {
            let root = sqrt(discriminant);
            let t = max((-b - root) / a, 0.0);
            let place = dot(from_a + t * dir, axis);
            if ((-b + root) / a >= 0.0 && place >= 0.0 && place <= length_2) {
                nearest = min(nearest, t);
            }
        }
    }
    return nearest;
}

fn hit(origin: vec3f, dir: vec3f, occluder: Occluder) -> f32 {
    switch (occluder.kind) {
        case 0u: { return hit_sphere(origin, dir, occluder.a, occluder.size.x); }
        case 1u: { return hit_box(origin, dir, occluder); }
        default: { return hit_capsule(origin, dir, occluder); }
    }
}

fn ray_radiance(slot: u32, probe: u32, ray: u32) -> vec3f {
    // ray_uv, ray_level and ray_distance are pages: they start at the page's first probe.
    let at = probe * params.n_rays + ray;
    let level = (ray_level[at / 4u] >> (8u * (at % 4u))) & 0xffu;
    if (OCCLUDERS) {
        let origin = probes[params.first_probe + probe].xyz;
        let dir = ray_dirs[ray].xyz;
        // Rays that leave the scene go infinitely far; what is missed is FARTHEST away and blocks nothing.
        var nearest = min(unpack2x16float(ray_distance[at / 2u])[at % 2u], FARTHEST);
        var blocked_by = MAX_OCCLUDERS;
        for (var i = 0u; i < atomicLoad(&n_near[slot]); i += 1u) {
            let index = near_occluders[slot][i];
            let distance = hit(origin, dir, occluders[index]);
            // Of equals the first one counts, in whatever order the list came about.
            let is_first = distance == nearest && blocked_by < MAX_OCCLUDERS && index < blocked_by;
            if (distance < nearest || is_first) {
                nearest = distance;
                blocked_by = index;
            }
        }
        if (blocked_by < MAX_OCCLUDERS) {
            return occluders[blocked_by].radiance;
        }
    }
    if (level == LEVEL_BLACK) {
        return vec3f(0.0);
    }
    if (level == LEVEL_SKY) {
        return select(vec3f(0.0), sky_rays[select(0u, ray, params.has_sky != 0u)].rgb, params.has_sky != 0u);
    }
    return read_light_map(level, ray_uv[at]);
}

@compute @workgroup_size(64)
fn probe_relight(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let number = linear_group(group, groups);
    let segment = number % params.n_segments;
    let first_probe = number / params.n_segments * PROBES;
    // The same for the whole workgroup.
    if (first_probe >= params.n_probes) {
        return;
    }
    if (OCCLUDERS) {
        // Cull: an occluder whose bounding sphere begins beyond all that the probe sees blocks nothing (probes.w is the
        // distance of the farthest hit).
        for (var slot = 0u; slot < PROBES; slot += 1u) {
            let probe = first_probe + slot;
            if (local < params.n_occluders && probe < params.n_probes) {
                let seen = probes[params.first_probe + probe];
                let center = select(occluders[local].a, 0.5 * (occluders[local].a + occluders[local].b),
                    occluders[local].kind == 2u);
                if (distance(seen.xyz, center) - occluders[local].bounding_radius < seen.w) {
                    near_occluders[slot][atomicAdd(&n_near[slot], 1u)] = local;
                }
            }
        }
        workgroupBarrier();
    }
    let begin = segment * RAYS_PER_SEGMENT;
    let end = min(begin + RAYS_PER_SEGMENT, params.n_rays);
    for (var first_j = 0u; first_j < N_SH; first_j += LANES) {
        let j = first_j + local;
        var sum_red = vec4f(0.0);
        var sum_green = vec4f(0.0);
        var sum_blue = vec4f(0.0);
        for (var first_ray = begin; first_ray < end; first_ray += LANES) {
            let ray = first_ray + local;
            for (var slot = 0u; slot < PROBES; slot += 1u) {
                var radiance = vec3f(0.0);
                if (ray < end && first_probe + slot < params.n_probes) {
                    radiance = ray_radiance(slot, first_probe + slot, ray);
                }
                red[local][slot] = radiance.r;
                green[local][slot] = radiance.g;
                blue[local][slot] = radiance.b;
            }
            workgroupBarrier();
            if (j < N_SH) {
                let n = min(LANES, end - first_ray);
                for (var i = 0u; i < n; i += 1u) {
                    let weight = ray_sh[(first_ray + i) * N_SH + j];
                    sum_red += weight * red[i];
                    sum_green += weight * green[i];
                    sum_blue += weight * blue[i];
                }
            }
            workgroupBarrier();
        }
        if (j < N_SH) {
            for (var slot = 0u; slot < PROBES && first_probe + slot < params.n_probes; slot += 1u) {
                let at = ((first_probe + slot) * params.n_segments + segment) * N_SH + j;
                partial_sums[at] = vec4f(sum_red[slot], sum_green[slot], sum_blue[slot], 0.0);
            }
        }
    }
}
