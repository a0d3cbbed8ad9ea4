// Shading with the maps of a Relighter, for the host's own shaders: joins any module, names begin with localprt_.
// No bindings, no entry points: the host binds the maps where it likes. Twin: host_shading.rs.
//
// World axes; directions are unit length and point away from the surface. Radiance in W sr^-1 m^-2, irradiance in W m^-2.
// Diffuse reflection is albedo / pi times irradiance.

const LOCALPRT_PI: f32 = 3.14159265;
// Y_00, and Y_1m over y, z, x.
const LOCALPRT_SH_0: f32 = 0.28209479;
const LOCALPRT_SH_1: f32 = 0.48860251;
// Below it GGX lobes are narrower than anything four coefficients can say, and f32 loses their peaks.
const LOCALPRT_LEAST_ROUGHNESS: f32 = 0.1;

// SH coefficients of degree 1: of radiance in a volume, or of a receiver, whose a + b n is fitted to irradiance about the normals around
// its own.
struct LocalprtRadiance {
    // Y_00.
    c0: vec3f,
    // Y_1-1, Y_10, Y_11: along y, z and x.
    cy: vec3f,
    cz: vec3f,
    cx: vec3f,
}

// Indirect irradiance at TEXCOORD_1; zero where no receiver is. `map` is irradiance_view(), filtered linearly, clamped.
fn localprt_sample_irradiance(map: texture_2d<f32>, map_sampler: sampler, uv: vec2f) -> vec3f {
    return localprt_divide_by_coverage(textureSampleLevel(map, map_sampler, uv, 0.0));
}

// A receiver's coefficients at TEXCOORD_1; zero where no receiver is. `map` is radiance_view(), filtered linearly, clamped.
fn localprt_sample_radiance(map: texture_2d_array<f32>, map_sampler: sampler, uv: vec2f) -> LocalprtRadiance {
    return LocalprtRadiance(
        localprt_divide_by_coverage(textureSampleLevel(map, map_sampler, uv, 0, 0.0)),
        localprt_divide_by_coverage(textureSampleLevel(map, map_sampler, uv, 1, 0.0)),
        localprt_divide_by_coverage(textureSampleLevel(map, map_sampler, uv, 2, 0.0)),
        localprt_divide_by_coverage(textureSampleLevel(map, map_sampler, uv, 3, 0.0)),
    );
}

// Texels that hold nothing are zero in color and alpha.
fn localprt_divide_by_coverage(sum: vec4f) -> vec3f {
    return select(vec3f(0.0), sum.rgb / sum.a, sum.a > 0.0);
}

// Irradiance about a shading normal, for normal maps; not negative. Ramamoorthi and Hanrahan 2001.
fn localprt_irradiance(radiance: LocalprtRadiance, normal: vec3f) -> vec3f {
    let constant = LOCALPRT_PI * LOCALPRT_SH_0 * radiance.c0;
    let linear = normal.y * radiance.cy + normal.z * radiance.cz + normal.x * radiance.cx;
    return max(constant + (2.0 / 3.0 * LOCALPRT_PI * LOCALPRT_SH_1) * linear, vec3f(0.0));
}

// Irradiance about a normal of something that light reaches from all around; not negative, and without the dark spot that
// localprt_irradiance() has opposite of a bright light. Hazel 2017.
fn localprt_irradiance_from_all_around(radiance: LocalprtRadiance, normal: vec3f) -> vec3f {
    return vec3f(
        localprt_band_from_all_around(radiance.c0.r, vec3f(radiance.cx.r, radiance.cy.r, radiance.cz.r), normal),
        localprt_band_from_all_around(radiance.c0.g, vec3f(radiance.cx.g, radiance.cy.g, radiance.cz.g), normal),
        localprt_band_from_all_around(radiance.c0.b, vec3f(radiance.cx.b, radiance.cy.b, radiance.cz.b), normal),
    );
}

fn localprt_band_from_all_around(c0: f32, linear: vec3f, normal: vec3f) -> f32 {
    let mean = LOCALPRT_PI * LOCALPRT_SH_0 * c0;
    let axis = LOCALPRT_PI / 3.0 * LOCALPRT_SH_1 * linear;
    let size = length(axis);
    if (mean <= 0.0) { return 0.0; }
    // More than 1 is no light's, but rounding's or the compression's.
    let ratio = min(size / mean, 1.0);
    let cosine = select(0.0, dot(axis, normal) / size, size > 0.0);
    let power = 1.0 + 2.0 * ratio;
    let constant = (1.0 - ratio) / (1.0 + ratio);
    let lobe = (power + 1.0) * pow(clamp(0.5 + 0.5 * cosine, 0.0, 1.0), power);
    return mean * (constant + (1.0 - constant) * lobe);
}

// SH radiance of degree 1 as one directional light in constant surroundings.
struct LocalprtDominantLight {
    // Unit, toward the light; zero if no direction is brighter than another.
    dir_to_light: vec3f,
    // On a surface that faces the light.
    irradiance: vec3f,
    // Radiance of the surroundings.
    ambient: vec3f,
}

// What a receiver holds as a directional light, b, in surroundings of irradiance a.
fn localprt_receiver_light(receiver: LocalprtRadiance) -> LocalprtDominantLight {
    let axis = vec3f(
        localprt_luminance(receiver.cx),
        localprt_luminance(receiver.cy),
        localprt_luminance(receiver.cz),
    );
    let size = length(axis);
    let dir_to_light = select(vec3f(0.0), axis / size, size > 0.0);
    let along = dir_to_light.x * receiver.cx + dir_to_light.y * receiver.cy + dir_to_light.z * receiver.cz;
    let irradiance = max((2.0 / 3.0 * LOCALPRT_PI * LOCALPRT_SH_1) * along, vec3f(0.0));
    return LocalprtDominantLight(dir_to_light, irradiance, max(LOCALPRT_SH_0 * receiver.c0, vec3f(0.0)));
}

// The linear terms of SH radiance as a directional light, the rest of the constant one as surroundings. Sloan 2008.
fn localprt_dominant_light(radiance: LocalprtRadiance) -> LocalprtDominantLight {
    let axis = vec3f(
        localprt_luminance(radiance.cx),
        localprt_luminance(radiance.cy),
        localprt_luminance(radiance.cz),
    );
    let size = length(axis);
    let dir_to_light = select(vec3f(0.0), axis / size, size > 0.0);
    let along = dir_to_light.x * radiance.cx + dir_to_light.y * radiance.cy + dir_to_light.z * radiance.cz;
    let irradiance = max(along / LOCALPRT_SH_1, vec3f(0.0));
    let ambient = max((radiance.c0 - LOCALPRT_SH_0 * irradiance) * LOCALPRT_SH_0, vec3f(0.0));
    return LocalprtDominantLight(dir_to_light, irradiance, ambient);
}

fn localprt_luminance(color: vec3f) -> f32 {
    return dot(color, vec3f(0.2126, 0.7152, 0.0722));
}

// Radiance that a directional light's mirror reflection sends to the eye: Cook-Torrance with GGX, height-correlated
// Smith and Schlick's Fresnel term. `irradiance` is that of a surface facing the light, `f0` the reflectance head on.
fn localprt_specular(
    dir_to_light: vec3f,
    irradiance: vec3f,
    normal: vec3f,
    dir_to_eye: vec3f,
    f0: vec3f,
    roughness: f32,
) -> vec3f {
    let n_l = dot(normal, dir_to_light);
    let n_v = max(dot(normal, dir_to_eye), 1e-4);
    if (n_l <= 0.0) { return vec3f(0.0); }
    // Light and eye opposite of each other have no half vector; the normal is one of many.
    let between = dir_to_light + dir_to_eye;
    let size = length(between);
    let half_dir = select(normal, between / size, size > 1e-6);
    let rough = clamp(roughness, LOCALPRT_LEAST_ROUGHNESS, 1.0);
    let alpha = rough * rough;
    let brdf = localprt_ggx(normal, half_dir, alpha) * localprt_smith(n_l, n_v, alpha);
    return localprt_schlick(f0, dot(dir_to_light, half_dir)) * irradiance * (brdf * n_l);
}

// The approximate indirect mirror reflection of sec. 5.1: that of a receiver's light.
fn localprt_indirect_specular(
    receiver: LocalprtRadiance,
    normal: vec3f,
    dir_to_eye: vec3f,
    f0: vec3f,
    roughness: f32,
) -> vec3f {
    let light = localprt_receiver_light(receiver);
    return localprt_specular(light.dir_to_light, light.irradiance, normal, dir_to_eye, f0, roughness);
}

// Density of microfacet normals, sr^-1: D of Walter et al. 2007, Eq. (33), for half vectors above the surface.
// The sine comes from the cross product, as 1 - cos^2 has no digits left near the peak.
fn localprt_ggx(normal: vec3f, half_dir: vec3f, alpha: f32) -> f32 {
    let n_h = dot(normal, half_dir);
    if (n_h <= 0.0) { return 0.0; }
    let across = cross(normal, half_dir);
    let spread = alpha / (dot(across, across) + n_h * n_h * alpha * alpha);
    return spread * spread / LOCALPRT_PI;
}

// Height-correlated Smith shadowing and masking over 4 n_l n_v. Heitz 2014, Eq. (99).
fn localprt_smith(n_l: f32, n_v: f32, alpha: f32) -> f32 {
    let alpha_2 = alpha * alpha;
    let masking = n_l * sqrt(n_v * n_v * (1.0 - alpha_2) + alpha_2);
    let shadowing = n_v * sqrt(n_l * n_l * (1.0 - alpha_2) + alpha_2);
    return 0.5 / (masking + shadowing);
}

fn localprt_schlick(f0: vec3f, cosine: f32) -> vec3f {
    let rest = clamp(1.0 - cosine, 0.0, 1.0);
    let rest_2 = rest * rest;
    return f0 + (vec3f(1.0) - f0) * (rest_2 * rest_2 * rest);
}
