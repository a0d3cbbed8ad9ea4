// Tone mapping: radiance times an exposure through Reinhard's curve; the target encodes sRGB.
// Draw: three vertices over the whole picture.

struct Params {
    scale: f32,
    white: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var radiance: texture_2d<f32>;

@vertex
fn whole_picture(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn tone_map(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let exposed = textureLoad(radiance, vec2i(position.xy), 0).rgb * params.scale;
    let value = clamp(exposed, vec3f(0.0), vec3f(params.white));
    // Reinhard et al. 2002, Eq. (4), each band by itself.
    return vec4f(value * (1.0 + value / (params.white * params.white)) / (1.0 + value), 1.0);
}
