// Engine map: what Godot samples, from the irradiance map. A scalar light map holds E / pi: Godot multiplies it by albedo alone.
// Dispatch: one invocation per texel, workgroups of 8 x 8.
//
// Godot does not divide by coverage, and its bicubic filter reads two texels to every side: texels that hold nothing take the mean of
// those around them that do.

@group(0) @binding(0) var irradiance_map: texture_2d<f32>;
@group(0) @binding(1) var written: texture_storage_2d_array<rgba16float, write>;

const PI: f32 = 3.14159265;
const REACH: i32 = 2;

@compute @workgroup_size(8, 8)
fn engine_map(@builtin(global_invocation_id) id: vec3u) {
    let size = vec2i(textureDimensions(irradiance_map));
    let texel = vec2i(id.xy);
    if (any(texel >= size)) {
        return;
    }
    let own = textureLoad(irradiance_map, texel, 0);
    var sum = own;
    if (own.a == 0.0) {
        for (var y = -REACH; y <= REACH; y += 1) {
            for (var x = -REACH; x <= REACH; x += 1) {
                let at = texel + vec2i(x, y);
                if (all(at >= vec2i(0)) && all(at < size)) {
                    // Nearer ones count more.
                    sum += textureLoad(irradiance_map, at, 0) / f32(max(x * x + y * y, 1));
                }
            }
        }
    }
    let irradiance = select(vec3f(0.0), sum.rgb / sum.a, sum.a > 0.0);
    textureStore(written, texel, 0, vec4f(irradiance / PI, 1.0));
}
