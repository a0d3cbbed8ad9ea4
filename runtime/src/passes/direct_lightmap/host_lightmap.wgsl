// Level 0 of the light map from a map of outgoing radiance that the host made: color times coverage, coverage in alpha.
// Dispatch: one invocation per texel, workgroups of 8 x 8.

@group(0) @binding(0) var host_map: texture_2d<f32>;
@group(0) @binding(1) var light_map: texture_storage_2d<MAP_FORMAT, write>;

@compute @workgroup_size(8, 8)
fn host_lightmap(@builtin(global_invocation_id) texel: vec3u) {
    if (any(texel.xy >= textureDimensions(host_map))) {
        return;
    }
    let value = textureLoad(host_map, texel.xy, 0);
    let coverage = clamp(value.a, 0.0, 1.0);
    if (coverage == 0.0) {
        textureStore(light_map, texel.xy, vec4f(0.0));
        return;
    }
    let radiance = clamp(value.rgb, vec3f(0.0), vec3f(MAP_LARGEST));
    textureStore(light_map, texel.xy, vec4f(radiance * coverage, coverage));
}
