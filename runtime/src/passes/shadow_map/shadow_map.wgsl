// Shadow maps: the casters' depth in one view, from both sides. Opaque triangles have no fragment stage, masked ones
// discard their holes. The view is the draw's instance.
// Draw: opaque indexed, masked by three vertices per triangle, one instance. Twin: reference.rs, shadow_map().
// Follows shadow_view.wgsl.

@group(0) @binding(0) var<storage, read> views: array<ShadowView>;

@vertex
fn opaque_vertex(@location(0) position: vec3f, @builtin(instance_index) view: u32) -> @builtin(position) vec4f {
    return clip_position(views[view], position);
}

// How one mask reads its image, as AlphaMask.
struct Mask {
    // First texel among the page's, in bytes.
    first_texel: u32,
    width: u32,
    height: u32,
    // WRAP_ values.
    wrap_u: u32,
    wrap_v: u32,
    // 1 for the nearest texel instead of bilinear.
    nearest: u32,
    cutoff: f32,
}

const WRAP_REPEAT = 0u;
const WRAP_MIRRORED_REPEAT = 1u;

@group(1) @binding(0) var<storage, read> masks: array<Mask>;
// Four texels per word, the first in the low byte.
@group(1) @binding(1) var<storage, read> mask_texels: array<u32>;

struct MaskedVertex {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec2f,
    @location(1) alpha: f32,
    @location(2) @interpolate(flat) mask: u32,
}

@vertex
fn masked_vertex(
    @location(0) position: vec3f,
    @location(1) uv: vec2f,
    @location(2) alpha: f32,
    @location(3) mask: u32,
    @builtin(instance_index) view: u32,
) -> MaskedVertex {
    return MaskedVertex(clip_position(views[view], position), uv, alpha, mask);
}

@fragment
fn masked_fragment(in: MaskedVertex) {
    let mask = masks[in.mask];
    if (in.alpha * mask_alpha(mask, in.uv) < mask.cutoff) {
        discard;
    }
}

// Twin: AlphaMask::sample() in casters.rs.
fn mask_alpha(mask: Mask, uv: vec2f) -> f32 {
    let size = vec2f(f32(mask.width), f32(mask.height));
    let at = vec2f(reduced(mask.wrap_u, uv.x), reduced(mask.wrap_v, uv.y)) * size;
    if (mask.nearest == 1u) {
        let texel = vec2i(floor(at));
        return mask_texel(mask, texel.x, texel.y);
    }
    let base = floor(at - 0.5);
    let fraction = at - 0.5 - base;
    let texel = vec2i(base);
    let top = mix(mask_texel(mask, texel.x, texel.y), mask_texel(mask, texel.x + 1, texel.y), fraction.x);
    let bottom = mix(mask_texel(mask, texel.x, texel.y + 1), mask_texel(mask, texel.x + 1, texel.y + 1), fraction.x);
    return mix(top, bottom, fraction.y);
}

fn mask_texel(mask: Mask, x: i32, y: i32) -> f32 {
    let column = wrapped(mask.wrap_u, x, i32(mask.width));
    let row = wrapped(mask.wrap_v, y, i32(mask.height));
    let texel = mask.first_texel + u32(row) * mask.width + u32(column);
    return f32(extractBits(mask_texels[texel / 4u], 8u * (texel % 4u), 8u)) / 255.0;
}

// Reduced first, so that far-out coordinates keep their fraction and all integers stay small.
fn reduced(wrap: u32, coordinate: f32) -> f32 {
    switch wrap {
        case WRAP_REPEAT: { return coordinate - floor(coordinate); }
        case WRAP_MIRRORED_REPEAT: { return coordinate - 2.0 * floor(coordinate * 0.5); }
        default: { return clamp(coordinate, 0.0, 1.0); }
    }
}

fn wrapped(wrap: u32, texel: i32, size: i32) -> i32 {
    switch wrap {
        case WRAP_REPEAT: { return (texel + size) % size; }
        case WRAP_MIRRORED_REPEAT: {
            let folded = (texel + 2 * size) % (2 * size);
            return min(folded, 2 * size - 1 - folded);
        }
        default: { return clamp(texel, 0, size - 1); }
    }
}
