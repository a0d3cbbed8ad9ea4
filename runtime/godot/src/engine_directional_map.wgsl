// Engine directional map: what Godot samples of receivers of degree 1. Layer 0 holds L0, the others t along y, z and x, of which Godot
// makes L0 (1 + 4 (2 t - 1) . n), to be E(n) / pi.
// Dispatch: one invocation per texel, workgroups of 8 x 8. Texels that hold nothing: as in engine_map.wgsl.

@group(0) @binding(0) var radiance_map: texture_2d_array<f32>;
@group(0) @binding(1) var written: texture_storage_2d_array<rgba16float, write>;

const SH_0: f32 = 0.28209479;
const SH_1: f32 = 0.48860251;
const REACH: i32 = 2;
// Factor of Godot's shaders on the linear terms.
const LINEAR: f32 = 4.0;
// Smallest normal number of f16: below it there is no light whose direction could be told.
const LEAST: f32 = 6.1035e-5;

fn filled(texel: vec2i, size: vec2i, layer: i32) -> vec3f {
    var sum = textureLoad(radiance_map, texel, layer, 0);
    if (sum.a == 0.0) {
        for (var y = -REACH; y <= REACH; y += 1) {
            for (var x = -REACH; x <= REACH; x += 1) {
                let at = texel + vec2i(x, y);
                if (all(at >= vec2i(0)) && all(at < size)) {
                    sum += textureLoad(radiance_map, at, layer, 0) / f32(max(x * x + y * y, 1));
                }
            }
        }
    }
    return select(vec3f(0.0), sum.rgb / sum.a, sum.a > 0.0);
}

@compute @workgroup_size(8, 8)
fn engine_directional_map(@builtin(global_invocation_id) id: vec3u) {
    let size = vec2i(textureDimensions(radiance_map));
    let texel = vec2i(id.xy);
    if (any(texel >= size)) {
        return;
    }
    // E(n) / pi = Y_0 c_0 + 2/3 (Y_1(n) c_1 + ...), A_0 = pi and A_1 = 2 pi / 3.
    let constant = max(SH_0 * filled(texel, size, 0), vec3f(0.0));
    textureStore(written, texel, 0, vec4f(constant, 1.0));
    for (var k = 1; k < 4; k += 1) {
        let linear = (2.0 / 3.0 * SH_1) * filled(texel, size, k);
        let share = select(vec3f(0.0), linear / (LINEAR * constant), constant > vec3f(LEAST));
        textureStore(written, texel, k, vec4f(0.5 + 0.5 * clamp(share, vec3f(-1.0), vec3f(1.0)), 1.0));
    }
}
