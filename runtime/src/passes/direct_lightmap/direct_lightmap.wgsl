// Direct light map: albedo, emission, direct light and the last gather's irradiance to outgoing radiance (sec. 4.2).
// Dispatch: one invocation per covered texel. Twin: reference.rs, direct_lightmap().

struct Params {
    n_texels: u32,
    size: u32,
    irradiance_size: u32,
    has_emission: u32,
    feedback_albedo_cap: f32,
    // Below 0: none.
    albedo_override: f32,
    n_materials: u32,
    pad: u32,
}

// Replaces albedo or emission where w is not 0.
struct Material {
    albedo: vec4f,
    emission: vec4f,
}

struct Surface {
    // Albedo r, g as unorm16.
    albedo_rg: u32,
    // Albedo b as unorm16, material index above.
    albedo_b_material: u32,
    // Place in the receiver map as unorm16.
    lightmap_uv: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> texel_index: array<u32>;
@group(0) @binding(2) var<storage, read> surface: array<Surface>;
@group(0) @binding(3) var<storage, read> emission: array<f32>;
@group(0) @binding(4) var<storage, read> materials: array<Material>;
@group(0) @binding(5) var<storage, read> direct: array<vec4f>;
@group(0) @binding(6) var irradiance_map: texture_2d<f32>;
@group(0) @binding(7) var light_map: texture_storage_2d<MAP_FORMAT, write>;

const PI: f32 = 3.14159265358979;

fn previous_irradiance(uv: vec2f) -> vec3f {
    let tap = bilinear_tap(uv, params.irradiance_size);
    // Texels hold irradiance and coverage 0 or 1; uncovered ones hold 0.
    let a = textureLoad(irradiance_map, tap.lower, 0);
    let b = textureLoad(irradiance_map, vec2u(tap.upper.x, tap.lower.y), 0);
    let c = textureLoad(irradiance_map, vec2u(tap.lower.x, tap.upper.y), 0);
    let d = textureLoad(irradiance_map, tap.upper, 0);
    return divide_by_coverage(bilinear(tap, a, b, c, d));
}

@compute @workgroup_size(64)
fn direct_lightmap(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let entry = linear_group(group, groups) * 64u + local;
    if (entry >= params.n_texels) {
        return;
    }
    let index = texel_index[entry];
    let texel = vec2u(index % params.size, index / params.size);
    let stored = surface[entry];
    let material_index = stored.albedo_b_material >> 16u;
    var albedo = vec3f(unpack2x16unorm(stored.albedo_rg), unpack2x16unorm(stored.albedo_b_material).x);
    var emitted = vec3f(0.0);
    if (params.has_emission != 0u) {
        emitted = vec3f(emission[3u * entry], emission[3u * entry + 1u], emission[3u * entry + 2u]);
    }
    if (material_index < params.n_materials) {
        let material = materials[material_index];
        albedo = select(albedo, clamp(material.albedo.rgb, vec3f(0.0), vec3f(1.0)), material.albedo.w != 0.0);
        emitted = select(emitted, material.emission.rgb, material.emission.w != 0.0);
    }
    albedo = select(albedo, vec3f(params.albedo_override), params.albedo_override >= 0.0);

    let indirect = previous_irradiance(unpack2x16unorm(stored.lightmap_uv));
    let feedback_albedo = clamp(albedo, vec3f(0.0), vec3f(params.feedback_albedo_cap));
    let reflected = albedo * direct[entry].rgb + feedback_albedo * max(indirect, vec3f(0.0));
    let outgoing = clamp(emitted + reflected / PI, vec3f(0.0), vec3f(MAP_LARGEST));
    textureStore(light_map, texel, vec4f(outgoing, 1.0));
}
