// Lines of a width in pixels, and probes as spheres of their radiance, over a finished scene.
// Draw: a line is an instance of four vertices in a strip, a probe one of a sphere. Lines and rims have display colors: they are put
// into the picture's radiance so that exposure and tone curve lead back to them.

struct Overlay {
    world_to_clip: mat4x4f,
    eye: vec3f,
    // Of the tone curve: 2^EV, and the exposed value that becomes white, 0 if there is no curve.
    scale: f32,
    size_px: vec2f,
    white: f32,
    // Of probe spheres.
    radius_m: f32,
    probe_degree: u32,
}

@group(0) @binding(0) var<uniform> overlay: Overlay;
// [n_probes, n_sh], RGB0.
@group(0) @binding(1) var<storage, read> probe_radiance: array<vec4f>;

// Largest number of f16.
const LARGEST = 65504.0;
// Lines are drawn by this share of their distance before what they lie on.
const NEARER = 0.002;
// Opacity of lines behind something.
const HIDDEN = 0.3;

// Radiance that the picture shows as a linear color: tone_map.wgsl inverted, y (1 + v) = v (1 + v / white^2).
fn display(color: vec3f) -> vec3f {
    let y = clamp(color, vec3f(0.0), vec3f(1.0));
    let rest = 1.0 - y;
    let white_2 = overlay.white * overlay.white;
    let curved = 0.5 * white_2 * (sqrt(rest * rest + 4.0 * y / max(white_2, 1e-6)) - rest);
    return min(select(y, curved, overlay.white > 0.0) / overlay.scale, vec3f(LARGEST));
}

struct LineVertex {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) color: vec4f,
}

@vertex
fn line_vertex(
    @builtin(vertex_index) corner: u32,
    @location(0) start: vec3f,
    @location(1) width_px: f32,
    @location(2) end: vec3f,
    @location(3) color: vec4f,
) -> LineVertex {
    var a = overlay.world_to_clip * vec4f(start, 1.0);
    var b = overlay.world_to_clip * vec4f(end, 1.0);
    // Clip w is the distance ahead of the eye, z that of the near plane. What lies before the near plane is cut away, as
    // there is no place in the picture for it.
    let near = a.z;
    if (max(a.w, b.w) <= near) { return LineVertex(vec4f(2.0, 2.0, 2.0, 1.0), color); }
    if (a.w < near) {
        a = mix(a, b, (near - a.w) / (b.w - a.w));
    } else if (b.w < near) {
        b = mix(b, a, (near - b.w) / (a.w - b.w));
    }
    let half_size = 0.5 * overlay.size_px;
    let a_px = a.xy / a.w * half_size;
    let b_px = b.xy / b.w * half_size;
    let difference = b_px - a_px;
    let size = length(difference);
    let along = select(vec2f(1.0, 0.0), difference / size, size > 1e-6);
    let across = vec2f(-along.y, along.x);
    // Bit 0 is the side, bit 1 the end. Ends reach half of the width farther, so that the lines of a ring meet.
    let side = f32(corner & 1u) * 2.0 - 1.0;
    let is_end = (corner & 2u) != 0u;
    let clip = select(a, b, is_end);
    let at_px = select(a_px - 0.5 * width_px * along, b_px + 0.5 * width_px * along, is_end);
    let at = (at_px + 0.5 * width_px * side * across) / half_size;
    let z = min(clip.z * (1.0 + NEARER), clip.w);
    return LineVertex(vec4f(at * clip.w, z, clip.w), color);
}

@fragment
fn line_fragment(in: LineVertex) -> @location(0) vec4f {
    return vec4f(display(in.color.rgb), in.color.a);
}

@fragment
fn hidden_line_fragment(in: LineVertex) -> @location(0) vec4f {
    return vec4f(display(in.color.rgb), in.color.a * HIDDEN);
}

struct SphereVertex {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) @interpolate(flat) probe: u32,
    // Negative unless highlighted.
    @location(3) @interpolate(flat) weight: f32,
}

@vertex
fn sphere_vertex(
    @builtin(instance_index) probe: u32,
    @location(0) normal: vec3f,
    @location(1) center: vec3f,
    @location(2) weight: f32,
) -> SphereVertex {
    let position = center + overlay.radius_m * normal;
    return SphereVertex(overlay.world_to_clip * vec4f(position, 1.0), position, normal, probe, weight);
}

// Display colors.
const RIM = vec3f(0.02, 0.02, 0.025);
const HIGHLIGHT = vec3f(1.0, 0.32, 0.02);

@fragment
fn sphere_fragment(in: SphereVertex) -> @location(0) vec4f {
    let normal = normalize(in.normal);
    let facing = clamp(dot(normal, normalize(overlay.eye - in.position)), 0.0, 1.0);
    let radiance = clamp(radiance_at_probe(in.probe, normal), vec3f(0.0), vec3f(LARGEST));
    // 0 in the middle of the disk, 1 at its edge.
    let from_middle = sqrt(1.0 - facing * facing);
    let is_highlighted = in.weight >= 0.0;
    let weight = clamp(in.weight, 0.0, 1.0);
    let width = select(0.06, 0.12 + 0.38 * weight, is_highlighted);
    let rim = select(RIM, mix(RIM, HIGHLIGHT, 0.35 + 0.65 * weight), is_highlighted);
    let share = smoothstep(1.0 - width - 0.04, 1.0 - width, from_middle);
    return vec4f(mix(radiance, display(rim), share), 1.0);
}

// SH radiance that arrives at a probe from a direction. Twin: Basis::accumulate() of localprt-formats.
fn radiance_at_probe(probe: u32, dir: vec3f) -> vec3f {
    let degree = overlay.probe_degree;
    let first = probe * (degree + 1u) * (degree + 1u);
    var sum = vec3f(0.0);
    // Re and Im of (x + iy)^m.
    var cosine = 1.0;
    var sine = 0.0;
    // Q_m^m.
    var diagonal = 0.28209479;
    for (var m = 0u; m <= degree; m++) {
        if (m > 0u) { diagonal *= sqrt(f32(2u * m + 1u) / f32(2u * m)); }
        var older = 0.0;
        var newer = diagonal * select(1.41421356, 1.0, m == 0u);
        for (var l = m; l <= degree; l++) {
            if (l > m) {
                let l_2 = f32(l * l);
                let m_2 = f32(m * m);
                let previous_2 = f32((l - 1u) * (l - 1u));
                let a = sqrt((4.0 * l_2 - 1.0) / (l_2 - m_2));
                let b = sqrt(max((previous_2 - m_2) / (4.0 * previous_2 - 1.0), 0.0));
                let next = a * (dir.z * newer - b * older);
                older = newer;
                newer = next;
            }
            let center = first + l * l + l;
            sum += newer * cosine * probe_radiance[center + m].rgb;
            if (m > 0u) { sum += newer * sine * probe_radiance[center - m].rgb; }
        }
        let real = dir.x * cosine - dir.y * sine;
        sine = dir.x * sine + dir.y * cosine;
        cosine = real;
    }
    return sum;
}
