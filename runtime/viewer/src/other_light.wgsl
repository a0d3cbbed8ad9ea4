// Indirect light of another system than the file's, right of a split: from a map of the receivers, or from octahedral irradiance probes as
// their papers shade with them (Majercik et al. 2019; Hvezda, sec. 3.4.1; Majercik et al. 2021, Eq. (2) and Fig. 4).
// Twins: cage_weights, Weights::of_probe, OctahedralMap and the irradiance of Ddgi and ScaledDdgi in localprt-systems.
// Follows scene_draw.wgsl.

struct OtherProbes {
    low: vec3f,
    // 1 for the map, OTHER_PROBES.
    kind: u32,
    spacing: vec3f,
    irradiance_side: u32,
    size: vec3u,
    distance_side: u32,
    normal_bias_m: f32,
    eye_bias_m: f32,
    is_cage_biased: u32,
    stored_power: f32,
    mean_power: f32,
    // Positions, then maps of irradiance, then of moments.
    texels: array<vec4f>,
}

const OTHER_PROBES = 2u;

@group(1) @binding(8) var other_map: texture_2d<f32>;
@group(1) @binding(9) var<storage, read> other: OtherProbes;

// Irradiance of a surface with a lightmap coordinate, W m^-2.
fn other_irradiance(position: vec3f, normal: vec3f, dir_to_eye: vec3f, lightmap_uv: vec2f) -> vec3f {
    if (other.kind == OTHER_PROBES) { return probes_irradiance(position, normal, dir_to_eye); }
    return localprt_sample_irradiance(other_map, map_sampler, lightmap_uv);
}

fn probes_irradiance(position: vec3f, normal: vec3f, dir_to_eye: vec3f) -> vec3f {
    let tested = position + normal * other.normal_bias_m + dir_to_eye * other.eye_bias_m;
    let place = (select(position, tested, other.is_cage_biased == 1u) - other.low) / other.spacing;
    let base = clamp(floor(place), vec3f(0.0), vec3f(other.size - 2u));
    let along = clamp(place - base, vec3f(0.0), vec3f(1.0));
    var sum = vec3f(0.0);
    var weights = 0.0;
    for (var corner = 0u; corner < 8u; corner++) {
        let step = vec3u(corner & 1u, corner >> 1u & 1u, corner >> 2u & 1u);
        let at = vec3u(base) + step;
        let probe = (at.z * other.size.y + at.y) * other.size.x + at.x;
        let stands = other.texels[probe];
        if (stands.w == 0.0) { continue; }
        let shares = mix(1.0 - along, along, vec3f(step));
        let weight = probe_weight(probe, stands.xyz, position, normal, tested) * shares.x * shares.y * shares.z;
        if (!(weight > 0.0)) { continue; }
        let stored = max(stored_irradiance(probe, normal), vec3f(0.0));
        sum += pow(stored, vec3f(other.stored_power)) * weight;
        weights += weight;
    }
    if (!(weights > 0.0)) { return vec3f(0.0); }
    return LOCALPRT_PI * pow(sum / weights, vec3f(other.mean_power));
}

// Smooth back face weight, Chebyshev and crush.
fn probe_weight(probe: u32, stands: vec3f, position: vec3f, normal: vec3f, tested: vec3f) -> f32 {
    let to_probe = stands - position;
    let length_to_probe = length(to_probe);
    let cosine = select(0.0, dot(to_probe, normal) / length_to_probe, length_to_probe > 0.0);
    let wrapped = (cosine + 1.0) * 0.5;
    var weight = wrapped * wrapped + 0.2;
    let from_probe = tested - stands;
    let distance = length(from_probe);
    if (distance > 0.0) {
        let moments = stored_moments(probe, from_probe / distance);
        if (distance > moments.x) {
            let variance = abs(moments.y - moments.x * moments.x);
            let beyond = distance - moments.x;
            let share = variance / (variance + beyond * beyond);
            weight *= share * share * share;
        }
    }
    weight = max(weight, 1e-6);
    return select(weight, weight * weight * weight / 0.04, weight < 0.2);
}

fn stored_irradiance(probe: u32, dir: vec3f) -> vec3f {
    let n_probes = other.size.x * other.size.y * other.size.z;
    return octahedral_read(n_probes, probe, other.irradiance_side, dir).rgb;
}

fn stored_moments(probe: u32, dir: vec3f) -> vec2f {
    let n_probes = other.size.x * other.size.y * other.size.z;
    let width = other.irradiance_side + 2u;
    return octahedral_read(n_probes * (1u + width * width), probe, other.distance_side, dir).xy;
}

// Bilinear, from the maps of a side that begin at `first`, each in a border of a texel.
fn octahedral_read(first: u32, probe: u32, side: u32, dir: vec3f) -> vec4f {
    let width = side + 2u;
    // Half a texel back to texel middles, a texel on for the border.
    let place = (octahedral_place(dir) + 1.0) * 0.5 * f32(side) + 0.5;
    let low = clamp(floor(place), vec2f(0.0), vec2f(f32(side)));
    let along = clamp(place - low, vec2f(0.0), vec2f(1.0));
    let texel = first + probe * width * width + u32(low.y) * width + u32(low.x);
    let top = mix(other.texels[texel], other.texels[texel + 1u], along.x);
    let bottom = mix(other.texels[texel + width], other.texels[texel + width + 1u], along.x);
    return mix(top, bottom, along.y);
}

// Place of a unit direction in the square of -1 to 1. Cigolle et al. 2014.
fn octahedral_place(dir: vec3f) -> vec2f {
    let flat = dir.xy / (abs(dir.x) + abs(dir.y) + abs(dir.z));
    let sides = select(vec2f(-1.0), vec2f(1.0), flat >= vec2f(0.0));
    return select((1.0 - abs(flat.yx)) * sides, flat, dir.z >= 0.0);
}
