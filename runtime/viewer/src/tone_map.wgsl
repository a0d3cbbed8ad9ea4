// Tone mapping: radiance times an exposure through a tone curve; the target encodes sRGB.
// Draw: three vertices over the whole picture. Twin: tone.rs, which names the sources.

struct Params {
    scale: f32,
    white: f32,
    // TONE_.
    curve: u32,
    // The first pixel after a white line from top to bottom; 0 without.
    split_px: f32,
}

const TONE_REINHARD = 0u;
const TONE_NEUTRAL = 1u;
const TONE_AGX = 2u;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var radiance: texture_2d<f32>;

@vertex
fn whole_picture(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn tone_map(@builtin(position) position: vec4f) -> @location(0) vec4f {
    if (params.split_px > 1.0 && abs(position.x - params.split_px) < 1.0) { return vec4f(1.0); }
    let exposed = max(textureLoad(radiance, vec2i(position.xy), 0).rgb * params.scale, vec3f(0.0));
    switch params.curve {
        case TONE_REINHARD: { return vec4f(reinhard(exposed), 1.0); }
        case TONE_NEUTRAL: { return vec4f(neutral(exposed), 1.0); }
        case TONE_AGX: { return vec4f(agx(exposed), 1.0); }
        default: { return vec4f(min(exposed, vec3f(1.0)), 1.0); }
    }
}

fn reinhard(exposed: vec3f) -> vec3f {
    let value = min(exposed, vec3f(params.white));
    return value * (1.0 + value / (params.white * params.white)) / (1.0 + value);
}

const F0 = 0.04;
const KNEE = 0.76;
const DESATURATION = 0.15;

fn neutral(exposed: vec3f) -> vec3f {
    let least = min(exposed.r, min(exposed.g, exposed.b));
    let color = exposed - select(F0, least - least * least / (4.0 * F0), least < 2.0 * F0);
    let peak = max(color.r, max(color.g, color.b));
    if (peak < KNEE) { return color; }
    let room = 1.0 - KNEE;
    let new_peak = 1.0 - room * room / (peak + room - KNEE);
    let whiteness = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    return mix(color * (new_peak / peak), vec3f(new_peak), whiteness);
}

const INSET = mat3x3f(
    vec3f(0.84247906, 0.042328242, 0.042375655),
    vec3f(0.0784336, 0.87846864, 0.0784336),
    vec3f(0.079223745, 0.07916613, 0.87914297),
);
const OUTSET = mat3x3f(
    vec3f(1.196879, -0.05289685, -0.052971635),
    vec3f(-0.09802088, 1.1519031, -0.09804345),
    vec3f(-0.09902974, -0.09896118, 1.1510737),
);
const LEAST_EV = -12.47393;
const MOST_EV = 4.026069;

fn agx(exposed: vec3f) -> vec3f {
    // Zero has no logarithm; what is below the range counts as its end.
    let inset = max(INSET * exposed, vec3f(exp2(LEAST_EV)));
    let x = clamp((log2(inset) - LEAST_EV) / (MOST_EV - LEAST_EV), vec3f(0.0), vec3f(1.0));
    let curve = (((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191) * x - 0.00232;
    // Encoded for a display of gamma 2.2.
    return min(pow(max(OUTSET * curve, vec3f(0.0)), vec3f(2.2)), vec3f(1.0));
}
