// Surfaces and sky as a camera sees them: emission, direct light with shadow maps, indirect light from the
// relighter's maps.
// Draw: surfaces indexed, the sky by three vertices. Objects are in objects.wgsl. Follows shadow_view.wgsl, direct_light.wgsl (which take
// group 0) and host.wgsl.

struct Frame {
    world_to_clip: mat4x4f,
    eye: vec3f,
    // FLAG_ bits.
    flags: u32,
    // Unit axes of the camera times half of the picture's size at distance 1.
    right: vec3f,
    sky_kind: u32,
    up: vec3f,
    sky_turns: f32,
    forward: vec3f,
    // Reflectance head on of every surface.
    f0: f32,
    zenith: vec3f,
    // Replaces that of materials unless negative.
    roughness: f32,
    horizon: vec3f,
    ground: vec3f,
    // VIEW_.
    view: u32,
    // From this pixel on indirect light is another system's.
    split_px: f32,
}

const FLAG_NORMAL_MAPS = 1u;
const FLAG_SPECULAR = 2u;
// The relighter has SH radiance.
const FLAG_RADIANCE = 4u;
const FLAG_CULL = 8u;
const SKY_EQUIRECT = 1u;

const VIEW_LIGHTING = 1u;
const VIEW_DIRECT = 2u;
const VIEW_INDIRECT = 3u;
const VIEW_MAP = 4u;
// Of surfaces that show light alone.
const GRAY_ALBEDO = 0.5;
// Bytes 40 and 128 of sRGB: what is no part of a map, and surfaces where the map has nothing.
const BACKDROP = vec3f(0.021219);
const NO_TEXEL = vec3f(0.215861);

struct Material {
    base_color: vec4f,
    emission: vec3f,
    // Surfaces are there where alpha is not below; negative for opaque ones.
    cutoff: f32,
    // Replaces base color and texture if w is 1.
    albedo: vec4f,
    // Replaces emission and texture if w is 1.
    own_emission: vec4f,
    normal_scale: f32,
    roughness: f32,
    has_normal_map: u32,
    is_double_sided: u32,
}

@group(1) @binding(0) var<uniform> frame: Frame;
@group(1) @binding(1) var irradiance_map: texture_2d<f32>;
@group(1) @binding(2) var radiance_map: texture_2d_array<f32>;
@group(1) @binding(3) var map_sampler: sampler;
@group(1) @binding(4) var<storage, read> materials: array<Material>;
@group(1) @binding(6) var sky_map: texture_2d<f32>;
@group(1) @binding(7) var receiver_map: texture_2d<f32>;

@group(2) @binding(0) var base_map: texture_2d<f32>;
@group(2) @binding(1) var base_sampler: sampler;
@group(2) @binding(2) var emission_map: texture_2d<f32>;
@group(2) @binding(3) var emission_sampler: sampler;
@group(2) @binding(4) var normal_map: texture_2d<f32>;
@group(2) @binding(5) var normal_sampler: sampler;

// Largest number of f16.
const LARGEST = 65504.0;

struct SurfaceVertex {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) tangent: vec4f,
    @location(3) base_uv: vec2f,
    @location(4) emission_uv: vec2f,
    @location(5) normal_uv: vec2f,
    @location(6) lightmap_uv: vec2f,
    @location(7) color: vec4f,
    @location(8) @interpolate(flat) material: u32,
}

@vertex
fn surface_vertex(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) tangent: vec4f,
    @location(3) base_uv: vec2f,
    @location(4) emission_uv: vec2f,
    @location(5) normal_uv: vec2f,
    @location(6) lightmap_uv: vec2f,
    @location(7) color: vec4f,
    @builtin(instance_index) material: u32,
) -> SurfaceVertex {
    let clip = frame.world_to_clip * vec4f(position, 1.0);
    return SurfaceVertex(clip, position, normal, tangent, base_uv, emission_uv, normal_uv, lightmap_uv, color, material);
}

@fragment
fn surface_fragment(in: SurfaceVertex, @builtin(front_facing) is_front: bool) -> @location(0) vec4f {
    // Everything that needs neighboring pixels comes before anything is left out.
    let dx = dpdx(in.position);
    let dy = dpdy(in.position);
    let uv_dx = dpdx(in.normal_uv);
    let uv_dy = dpdy(in.normal_uv);
    let base_texel = textureSample(base_map, base_sampler, in.base_uv);
    let emission_texel = textureSample(emission_map, emission_sampler, in.emission_uv).rgb;
    let normal_texel = textureSample(normal_map, normal_sampler, in.normal_uv).xyz * 2.0 - 1.0;

    let material = materials[in.material];
    let base = material.base_color * base_texel * in.color;
    if (base.a < material.cutoff) { discard; }
    let is_seen = is_front || material.is_double_sided == 1u;
    if (!is_seen) {
        if ((frame.flags & FLAG_CULL) != 0u) { discard; }
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    if (frame.view == VIEW_MAP) { return vec4f(receiver_color(in.lightmap_uv), 1.0); }
    let dir_to_eye = normalize(frame.eye - in.position);
    // Rows go down: dy x dx looks at the eye.
    var geometric_normal = normalize(cross(dy, dx));
    if (dot(geometric_normal, dir_to_eye) < 0.0) { geometric_normal = -geometric_normal; }
    var normal = normalize(select(-in.normal, in.normal, is_front));
    if (!(dot(normal, geometric_normal) > 0.0)) { normal = geometric_normal; }
    let is_mapped = (frame.flags & FLAG_NORMAL_MAPS) != 0u && material.has_normal_map == 1u;
    if (is_mapped) {
        // From behind, the map's bumps are dents: the same surface, reversed.
        let side = select(-1.0, 1.0, is_front);
        let tangent = tangent_frame(in, normal * side, dx, dy, uv_dx, uv_dy);
        let bent = tangent * vec3f(normal_texel.xy * material.normal_scale, normal_texel.z);
        normal = normalize(bent) * side;
    }

    let albedo = clamp(select(base.rgb, material.albedo.rgb, material.albedo.w == 1.0), vec3f(0.0), vec3f(1.0));
    let own = material.emission * emission_texel;
    let emission = select(own, material.own_emission.rgb, material.own_emission.w == 1.0);
    let roughness = select(material.roughness, frame.roughness, frame.roughness >= 0.0);

    let direct = direct_light(in.position, normal, geometric_normal, dir_to_eye, roughness);
    var indirect = vec3f(0.0);
    var mirrored = direct.mirrored;
    if (in.clip.x >= frame.split_px) {
        indirect = other_irradiance(in.position, normal, dir_to_eye, in.lightmap_uv);
    } else if ((frame.flags & FLAG_RADIANCE) != 0u && (frame.flags & (FLAG_NORMAL_MAPS | FLAG_SPECULAR)) != 0u) {
        let radiance = localprt_sample_radiance(radiance_map, map_sampler, in.lightmap_uv);
        if ((frame.flags & FLAG_SPECULAR) != 0u) {
            mirrored += localprt_indirect_specular(radiance, normal, dir_to_eye, vec3f(frame.f0), roughness);
        }
        if (is_mapped) {
            indirect = localprt_irradiance(radiance, normal);
        } else {
            indirect = localprt_sample_irradiance(irradiance_map, map_sampler, in.lightmap_uv);
        }
    } else {
        indirect = localprt_sample_irradiance(irradiance_map, map_sampler, in.lightmap_uv);
    }
    return vec4f(min(viewed(emission, albedo, direct.irradiance, indirect, mirrored), vec3f(LARGEST)), 1.0);
}

// Radiance as the view has it: all of it, or parts on gray surfaces.
fn viewed(emission: vec3f, albedo: vec3f, direct: vec3f, indirect: vec3f, mirrored: vec3f) -> vec3f {
    let gray = GRAY_ALBEDO / LOCALPRT_PI;
    switch frame.view {
        case VIEW_LIGHTING: { return emission + gray * (direct + indirect); }
        case VIEW_DIRECT: { return gray * direct; }
        case VIEW_INDIRECT: { return gray * indirect; }
        case VIEW_MAP: { return BACKDROP; }
        default: { return emission + albedo / LOCALPRT_PI * (direct + indirect) + mirrored; }
    }
}

// The map's color in the texel of a lightmap coordinate, which is negative for meshes without.
fn receiver_color(uv: vec2f) -> vec3f {
    let size = vec2i(textureDimensions(receiver_map));
    let texel = textureLoad(receiver_map, clamp(vec2i(floor(uv * vec2f(size))), vec2i(0), size - 1), 0);
    return select(NO_TEXEL, texel.rgb, texel.a > 0.0 && uv.x > -0.5);
}

// Tangent, bitangent and the normal of the front; from the change of the coordinates over the picture where the scene has no tangents.
fn tangent_frame(
    in: SurfaceVertex,
    normal: vec3f,
    dx: vec3f,
    dy: vec3f,
    uv_dx: vec2f,
    uv_dy: vec2f,
) -> mat3x3f {
    if (in.tangent.w != 0.0) {
        let across = in.tangent.xyz - normal * dot(normal, in.tangent.xyz);
        if (dot(across, across) > 0.0) {
            let tangent = normalize(across);
            return mat3x3f(tangent, cross(normal, tangent) * sign(in.tangent.w), normal);
        }
    }
    let x_axis = cross(dy, normal);
    let y_axis = cross(normal, dx);
    let tangent = x_axis * uv_dx.x + y_axis * uv_dy.x;
    // Normal maps have +Y up, images have v down.
    let bitangent = -(x_axis * uv_dx.y + y_axis * uv_dy.y);
    let size_2 = max(dot(tangent, tangent), dot(bitangent, bitangent));
    if (!(size_2 > 0.0)) { return mat3x3f(vec3f(0.0), vec3f(0.0), normal); }
    // Both axes have the sign of the area that dx and dy span, seen from the normal.
    let side = sign(dot(cross(dx, dy), normal));
    return mat3x3f(tangent * (side / sqrt(size_2)), bitangent * (side / sqrt(size_2)), normal);
}

struct DirectLight {
    irradiance: vec3f,
    mirrored: vec3f,
}

fn direct_light(
    position: vec3f,
    normal: vec3f,
    geometric_normal: vec3f,
    dir_to_eye: vec3f,
    roughness: f32,
) -> DirectLight {
    var sum = DirectLight(vec3f(0.0), vec3f(0.0));
    for (var index = batch.first_light; index < batch.first_light + batch.n_lights; index++) {
        let incident = incident_light(index, position, geometric_normal);
        sum.irradiance += incident.irradiance * max(dot(normal, incident.dir_to_light), 0.0);
        if ((frame.flags & FLAG_SPECULAR) != 0u) {
            let f0 = vec3f(frame.f0);
            sum.mirrored +=
                localprt_specular(incident.dir_to_light, incident.irradiance, normal, dir_to_eye, f0, roughness);
        }
    }
    return sum;
}

struct SkyVertex {
    @builtin(position) clip: vec4f,
    @location(0) dir: vec3f,
}

@vertex
fn sky_vertex(@builtin(vertex_index) index: u32) -> SkyVertex {
    let at = vec2f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
    // Depth 0 is infinitely far.
    return SkyVertex(vec4f(at, 0.0, 1.0), frame.forward + at.x * frame.right + at.y * frame.up);
}

@fragment
fn sky_fragment(in: SkyVertex) -> @location(0) vec4f {
    let none = vec3f(0.0);
    return vec4f(min(viewed(sky_radiance(normalize(in.dir)), none, none, none, none), vec3f(LARGEST)), 1.0);
}

// Twin: Sky::radiance() of localprt-scenes.
fn sky_radiance(dir: vec3f) -> vec3f {
    if (frame.sky_kind != SKY_EQUIRECT) {
        return mix(frame.horizon, select(frame.ground, frame.zenith, dir.y >= 0.0), abs(dir.y));
    }
    let turns = atan2(dir.x, -dir.z) / (2.0 * LOCALPRT_PI) + frame.sky_turns;
    let v = atan2(length(dir.xz), dir.y) / LOCALPRT_PI;
    let size = vec2i(textureDimensions(sky_map));
    let at = vec2f(turns - floor(turns), v) * vec2f(size) - 0.5;
    let base = floor(at);
    let share = at - base;
    let texel = vec2i(base);
    let top = mix(sky_texel(texel, size), sky_texel(texel + vec2i(1, 0), size), share.x);
    let bottom = mix(sky_texel(texel + vec2i(0, 1), size), sky_texel(texel + vec2i(1, 1), size), share.x);
    return mix(top, bottom, share.y);
}

// Wrapped around, clamped at the poles.
fn sky_texel(texel: vec2i, size: vec2i) -> vec3f {
    let column = (texel.x + size.x) % size.x;
    return textureLoad(sky_map, vec2i(column, clamp(texel.y, 0, size.y - 1)), 0).rgb;
}
