// Indirect light of another system than the file's, right of a split: from a map of the receivers, or from the system's probes as its
// paper shades with them: octahedral irradiance (Majercik et al. 2019; Hvezda, sec. 3.4.1; Majercik et al. 2021, Eq. (2) and Fig. 4;
// McGuire et al. 2017, sec. 5.2) and spherical harmonics in nested grids (Wang, Bowles and Weeks 2022, sec. 6.2).
// Twins, in localprt-systems: cage_weights, Weights::of_probe, OctahedralMap and the irradiance of Ddgi and ScaledDdgi; weight() of
// light_field::prefilter; Cascades::around and Coefficients::irradiance.
// Follows scene_draw.wgsl.

struct Other {
    low: vec3f,
    // OTHER_.
    kind: u32,
    spacing: vec3f,
    irradiance_side: u32,
    // Probes along each axis, of each grid.
    size: vec3u,
    distance_side: u32,
    normal_bias_m: f32,
    eye_bias_m: f32,
    is_cage_biased: u32,
    stored_power: f32,
    mean_power: f32,
    n_grids: u32,
    // Octahedral probes: positions, then maps of irradiance, then of moments.
    // Harmonics: low and spacing of each grid, then nine coefficients of each probe.
    texels: array<vec4f>,
}

const OTHER_MAP = 1u;
const OTHER_WRAPPED = 2u;
const OTHER_FACING = 3u;
const OTHER_HARMONICS = 4u;

@group(1) @binding(8) var other_map: texture_2d<f32>;
@group(1) @binding(9) var<storage, read> other: Other;

// Irradiance of a surface with a lightmap coordinate, W m^-2.
fn other_irradiance(position: vec3f, normal: vec3f, dir_to_eye: vec3f, lightmap_uv: vec2f) -> vec3f {
    if (other.kind != OTHER_MAP) { return other_irradiance_anywhere(position, normal, dir_to_eye); }
    return localprt_sample_irradiance(other_map, map_sampler, lightmap_uv);
}

// The same where there is no lightmap; kinds other than the map.
fn other_irradiance_anywhere(position: vec3f, normal: vec3f, dir_to_eye: vec3f) -> vec3f {
    if (other.kind == OTHER_HARMONICS) { return harmonics_irradiance(position, normal); }
    return octahedral_irradiance(position, normal, dir_to_eye);
}

struct Cage {
    // The probe at its lowest corner.
    base: vec3u,
    // How far the point is on the way to the next one along each axis, 0 to 1.
    along: vec3f,
}

// Of a point, given in spacings from the first probe; of one outside, that at the border.
fn cage_of(place: vec3f) -> Cage {
    let base = clamp(floor(place), vec3f(0.0), vec3f(other.size - 2u));
    return Cage(vec3u(base), clamp(place - base, vec3f(0.0), vec3f(1.0)));
}

struct Corner {
    probe: u32,
    trilinear: f32,
}

// Bit k of the number is a step along axis k.
fn corner_of(cage: Cage, corner: u32) -> Corner {
    let step = vec3u(corner & 1u, (corner >> 1u) & 1u, (corner >> 2u) & 1u);
    let at = cage.base + step;
    let shares = mix(1.0 - cage.along, cage.along, vec3f(step));
    return Corner((at.z * other.size.y + at.y) * other.size.x + at.x, shares.x * shares.y * shares.z);
}

fn octahedral_irradiance(position: vec3f, normal: vec3f, dir_to_eye: vec3f) -> vec3f {
    let tested = position + normal * other.normal_bias_m + dir_to_eye * other.eye_bias_m;
    let cage = cage_of((select(position, tested, other.is_cage_biased == 1u) - other.low) / other.spacing);
    var sum = vec3f(0.0);
    var weights = 0.0;
    for (var number = 0u; number < 8u; number++) {
        let corner = corner_of(cage, number);
        let stands = other.texels[corner.probe];
        if (stands.w == 0.0) { continue; }
        var weight = 0.0;
        if (other.kind == OTHER_FACING) {
            weight = facing_weight(corner, stands.xyz, position, normal);
        } else {
            weight = wrapped_weight(corner, stands.xyz, position, normal, tested);
        }
        if (!(weight > 0.0)) { continue; }
        let stored = max(stored_irradiance(corner.probe, normal), vec3f(0.0));
        sum += pow(stored, vec3f(other.stored_power)) * weight;
        weights += weight;
    }
    if (!(weights > 0.0)) { return vec3f(0.0); }
    return LOCALPRT_PI * pow(sum / weights, vec3f(other.mean_power));
}

// Trilinear, smooth back face weight, Chebyshev and crush.
fn wrapped_weight(corner: Corner, stands: vec3f, position: vec3f, normal: vec3f, tested: vec3f) -> f32 {
    let to_probe = stands - position;
    let length_to_probe = length(to_probe);
    let cosine = select(0.0, dot(to_probe, normal) / length_to_probe, length_to_probe > 0.0);
    let wrapped = (cosine + 1.0) * 0.5;
    let seen = seen_share(corner.probe, tested - stands);
    let weight = max((wrapped * wrapped + 0.2) * seen * seen * seen, 1e-6);
    return corner.trilinear * select(weight, weight * weight * weight / 0.04, weight < 0.2);
}

// Trilinear, clamped cosine and Chebyshev.
fn facing_weight(corner: Corner, stands: vec3f, position: vec3f, normal: vec3f) -> f32 {
    let to_probe = stands - position;
    let length_to_probe = length(to_probe);
    let cosine = select(0.0, dot(to_probe, normal) / length_to_probe, length_to_probe > 0.0);
    return max(corner.trilinear * max(cosine, 0.05) * seen_share(corner.probe, -to_probe), 2e-4);
}

// Most that can be seen of what is so far from a probe, by Chebyshev's inequality.
fn seen_share(probe: u32, from_probe: vec3f) -> f32 {
    let distance = length(from_probe);
    if (!(distance > 0.0)) { return 1.0; }
    let moments = stored_moments(probe, from_probe / distance);
    if (distance <= moments.x) { return 1.0; }
    let variance = abs(moments.y - moments.x * moments.x);
    let beyond = distance - moments.x;
    return variance / (variance + beyond * beyond);
}

// Trilinear in each grid: in the finest that holds the point, and across its border in the next. The last holds all that is left.
fn harmonics_irradiance(position: vec3f, normal: vec3f) -> vec3f {
    var lobe = cosine_lobe(normal);
    let last = vec3f(other.size - 1u);
    let n_probes = other.size.x * other.size.y * other.size.z;
    var sum = vec3f(0.0);
    var left = 1.0;
    for (var grid = 0u; grid < other.n_grids; grid++) {
        let place = (position - other.texels[2u * grid].xyz) / other.texels[2u * grid + 1u].xyz;
        // 1 well inside of the grid, 0 outside, in between over a cell, but not more than a quarter of them.
        let inside = min(place, last - place) / min(last * 0.25, vec3f(1.0));
        let share = left * select(clamp(min(min(inside.x, inside.y), inside.z), 0.0, 1.0), 1.0, grid + 1u == other.n_grids);
        left -= share;
        if (!(share > 0.0)) { continue; }
        let cage = cage_of(place);
        for (var number = 0u; number < 8u; number++) {
            let corner = corner_of(cage, number);
            let first = 2u * other.n_grids + 9u * (grid * n_probes + corner.probe);
            for (var k = 0u; k < 9u; k++) {
                sum += share * corner.trilinear * lobe[k] * other.texels[first + k].rgb;
            }
        }
    }
    return max(sum, vec3f(0.0));
}

// Real spherical harmonics of three bands times pi, 2 pi / 3 and pi / 4. Ramamoorthi and Hanrahan 2001.
fn cosine_lobe(normal: vec3f) -> array<f32, 9> {
    let constant = LOCALPRT_PI * LOCALPRT_SH_0;
    let linear = 2.0 / 3.0 * LOCALPRT_PI * LOCALPRT_SH_1 * normal;
    let quadratic = LOCALPRT_PI / 4.0;
    return array(
        constant,
        linear.y,
        linear.z,
        linear.x,
        quadratic * 1.0925484 * normal.x * normal.y,
        quadratic * 1.0925484 * normal.y * normal.z,
        quadratic * 0.31539157 * (3.0 * normal.z * normal.z - 1.0),
        quadratic * 1.0925484 * normal.x * normal.z,
        quadratic * 0.54627422 * (normal.x * normal.x - normal.y * normal.y),
    );
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
