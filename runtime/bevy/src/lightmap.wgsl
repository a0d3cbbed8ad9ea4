// Light map of Bevy: irradiance over pi, cd/m², times a scale. Dispatch: ceil(size / 8) per axis.

@group(0) @binding(0) var irradiance_map: texture_2d<f32>;
@group(0) @binding(1) var light_map: texture_storage_2d<rgba16float, write>;
// Scale over pi.
@group(0) @binding(2) var<uniform> factor: f32;

// Largest number of f16.
const LARGEST: f32 = 65504.0;

@compute @workgroup_size(8, 8)
fn lightmap(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= textureDimensions(irradiance_map))) { return; }
    let irradiance = textureLoad(irradiance_map, id.xy, 0);
    textureStore(light_map, id.xy, vec4f(min(irradiance.rgb * factor, vec3f(LARGEST)), irradiance.a));
}
