// What a surface sends to the eye: emission, direct light by the relighter's shadow maps, indirect light by its map.
// Follows DIRECT_LIGHT_WGSL, which takes bind group 0, and HOST_WGSL.

@group(1) @binding(0) var<uniform> world_to_clip: mat4x4f;
@group(1) @binding(1) var irradiance_map: texture_2d<f32>;
@group(1) @binding(2) var map_sampler: sampler;

const EXPOSURE = 2.0;

struct Surface {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) @interpolate(flat) geometric_normal: vec3f,
    @location(3) lightmap_uv: vec2f,
    @location(4) albedo: vec3f,
    @location(5) emission: vec3f,
}

@vertex
fn surface_vertex(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) geometric_normal: vec3f,
    // Two of three numbers.
    @location(3) lightmap_uv: vec3f,
    @location(4) albedo: vec3f,
    @location(5) emission: vec3f,
) -> Surface {
    let clip = world_to_clip * vec4f(position, 1.0);
    return Surface(clip, position, normal, geometric_normal, lightmap_uv.xy, albedo, emission);
}

@fragment
fn surface_fragment(in: Surface) -> @location(0) vec4f {
    let normal = normalize(in.normal);
    var irradiance = localprt_sample_irradiance(irradiance_map, map_sampler, in.lightmap_uv);
    for (var index = batch.first_light; index < batch.first_light + batch.n_lights; index++) {
        let incident = incident_light(index, in.position, in.geometric_normal);
        irradiance += incident.irradiance * max(dot(normal, incident.dir_to_light), 0.0);
    }
    let exposed = EXPOSURE * (in.emission + in.albedo / LOCALPRT_PI * irradiance);
    return vec4f(exposed / (1.0 + exposed), 1.0);
}
