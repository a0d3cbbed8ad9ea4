// Direct irradiance: one invocation adds the lights of one batch to one covered texel, RGB in W m^-2: the mean over its samples.
// Dispatch: ceil(n_texels / 64) workgroups in rows of at most the device's limit, per page of texels and batch of lights.
// Twin: reference.rs, add_light() for each light of the batch, in order.
// Follows shadow_view.wgsl and direct_light.wgsl.

// Ten words a texel: position, shading normal, geometric normal, all f32, and the end of its samples.
@group(1) @binding(0) var<storage, read> texels: array<u32>;
@group(1) @binding(1) var<storage, read_write> irradiance: array<vec4f>;
// The samples of the page's texels, as TexelSample has them. A texel without any is lit at its own point.
@group(1) @binding(2) var<storage, read> samples: array<vec4u>;

const WORDS_PER_TEXEL = 10u;

@compute @workgroup_size(64)
fn direct_irradiance(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) n_workgroups: vec3u) {
    let texel = id.y * n_workgroups.x * 64u + id.x;
    if (texel >= arrayLength(&irradiance)) { return; }
    let word = WORDS_PER_TEXEL * texel;
    let own = SurfacePoint(texel_vector(word), texel_vector(word + 3u), texel_vector(word + 6u));
    var first = 0u;
    if (texel > 0u) { first = texels[word - 1u]; }
    let n_samples = texels[word + 9u] - first;
    var sum = vec3f(0.0);
    if (batch.is_first == 0u) { sum = irradiance[texel].rgb; }
    for (var index = batch.first_light; index < batch.first_light + batch.n_lights; index++) {
        if (n_samples == 0u) {
            sum += from_light(index, own);
            continue;
        }
        var all = vec3f(0.0);
        for (var sample = first; sample < first + n_samples; sample++) {
            all += from_light(index, sample_point(samples[sample], own.position));
        }
        sum += all / f32(n_samples);
    }
    irradiance[texel] = vec4f(sum, 0.0);
}

fn from_light(index: u32, point: SurfacePoint) -> vec3f {
    let incident = incident_light(index, point.position, point.geometric_normal);
    return incident.irradiance * max(dot(point.normal, incident.dir_to_light), 0.0);
}

struct SurfacePoint {
    position: vec3f,
    normal: vec3f,
    geometric_normal: vec3f,
}

// Twin: TexelSample::point().
fn sample_point(words: vec4u, texel_position: vec3f) -> SurfacePoint {
    let offset = bitcast<vec3f>(words.xyz & vec3u(0xffffff00u));
    // The lowest byte, with its sign.
    let geometric_normal = vec3f(bitcast<vec3i>(words.xyz << vec3u(24u)) >> vec3u(24u));
    let shading = vec2i(extractBits(bitcast<i32>(words.w), 0u, 16u), extractBits(bitcast<i32>(words.w), 16u, 16u));
    return SurfacePoint(
        texel_position + offset,
        from_octahedral(vec2f(shading) / 32767.0),
        normalize(geometric_normal)
    );
}

// Twin: from_octahedral().
fn from_octahedral(flat: vec2f) -> vec3f {
    let z = 1.0 - abs(flat.x) - abs(flat.y);
    let fold = max(-z, 0.0);
    return normalize(vec3f(flat - select(vec2f(-fold), vec2f(fold), flat >= vec2f(0.0)), z));
}

fn texel_vector(first: u32) -> vec3f {
    return bitcast<vec3f>(vec3u(texels[first], texels[first + 1u], texels[first + 2u]));
}
