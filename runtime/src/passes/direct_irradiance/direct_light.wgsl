// One batch of lights with its shadow maps, at any point: for the texels of the direct light map and for hosts' pixels.
// Part of a module, declares group 0. Follows shadow_view.wgsl. Twin: reference.rs, add_light().

struct Light {
    // Not of directional lights.
    position: vec3f,
    // 1 / range in metres, 0 if there is none.
    inverse_range: f32,
    // In which the light travels; not of point lights.
    direction: vec3f,
    // Of spots (0 and 1 else): cone_scale cos + cone_offset, clamped and squared, is the share of the intensity.
    cone_scale: f32,
    // Color times intensity.
    emitted: vec3f,
    cone_offset: f32,
    is_directional: u32,
    first_view: u32,
    // One, or six faces.
    n_views: u32,
}

struct Batch {
    first_light: u32,
    n_lights: u32,
    // The view in the first layer of the maps.
    first_view: u32,
    // 1 for the first batch, which overwrites what was there.
    is_first: u32,
    // Length within the rounding of positions, metres.
    rounding_m: f32,
}

@group(0) @binding(0) var<uniform> batch: Batch;
@group(0) @binding(1) var<storage, read> lights: array<Light>;
@group(0) @binding(2) var<storage, read> views: array<ShadowView>;
@group(0) @binding(3) var shadow_maps: texture_depth_2d_array;

struct Incident {
    dir_to_light: vec3f,
    irradiance: vec3f,
}

// The light of one number, shadows included, on a surface that faces it; nothing behind the geometric normal.
fn incident_light(index: u32, position: vec3f, geometric_normal: vec3f) -> Incident {
    let light = lights[index];
    var incident = light_at(light, position);
    let reaches = max(incident.irradiance.r, max(incident.irradiance.g, incident.irradiance.b)) > 0.0;
    if (!reaches || dot(geometric_normal, incident.dir_to_light) <= 0.0) {
        return Incident(incident.dir_to_light, vec3f(0.0));
    }
    var view = light.first_view;
    if (light.n_views == 6u) { view += face(position - light.position); }
    incident.irradiance *= visibility(view, position, geometric_normal);
    return incident;
}

// Twin: Light::incident() of localprt-scenes.
fn light_at(light: Light, position: vec3f) -> Incident {
    if (light.is_directional == 1u) { return Incident(-light.direction, light.emitted); }
    let to_light = light.position - position;
    let distance = length(to_light);
    if (distance == 0.0) { return Incident(vec3f(0.0), vec3f(0.0)); }
    let dir_to_light = to_light / distance;
    // Past twice the range nothing changes; keeps the power finite.
    let ratio = min(distance * light.inverse_range, 2.0);
    let window = clamp(1.0 - ratio * ratio * ratio * ratio, 0.0, 1.0);
    let ramp = clamp(dot(light.direction, -dir_to_light) * light.cone_scale + light.cone_offset, 0.0, 1.0);
    return Incident(dir_to_light, light.emitted * (window * (ramp * ramp) / (distance * distance)));
}

// Twin: ShadowView::face().
fn face(from_light: vec3f) -> u32 {
    let size = abs(from_light);
    if (size.x >= size.y && size.x >= size.z) { return select(0u, 1u, from_light.x < 0.0); }
    if (size.y >= size.z) { return select(2u, 3u, from_light.y < 0.0); }
    return select(4u, 5u, from_light.z < 0.0);
}

// Factor on the least offset from a flat surface, as OFFSET_MARGIN in views.rs.
const OFFSET_MARGIN = 1.125;

// Twin: ShadowView::receiver_offset_m().
fn receiver_offset_m(view: ShadowView, position: vec3f, normal: vec3f, map_size: f32) -> f32 {
    let z = dot(position - view.origin, view.forward);
    let texel = (view.w_0 + view.w_z * z) * 2.0 / map_size;
    let across = abs(dot(normal, view.right)) / view.scale_x + abs(dot(normal, view.up)) / view.scale_y;
    return batch.rounding_m + OFFSET_MARGIN * texel * across;
}

// Twin: ShadowMap::visibility().
fn visibility(view_index: u32, position: vec3f, normal: vec3f) -> f32 {
    let view = views[view_index];
    let map_size = f32(textureDimensions(shadow_maps).x);
    let moved = position + normal * receiver_offset_m(view, position, normal, map_size);
    let clip = clip_position(view, moved);
    if (clip.w <= 0.0) { return 1.0; }
    // Behind the farthest caster depth ends at 0, which is nothing.
    let depth = max(clip.z / clip.w, 0.0);
    let half_size = 0.5 * map_size;
    let at = vec2f(half_size + half_size * (clip.x / clip.w), half_size - half_size * (clip.y / clip.w)) - 0.5;
    let base = floor(at);
    let fraction = at - base;
    let texel = vec2i(base);
    let layer = view_index - batch.first_view;
    let top = mix(lit(layer, texel, depth), lit(layer, texel + vec2i(1, 0), depth), fraction.x);
    let bottom = mix(lit(layer, texel + vec2i(0, 1), depth), lit(layer, texel + vec2i(1, 1), depth), fraction.x);
    return mix(top, bottom, fraction.y);
}

fn lit(layer: u32, texel: vec2i, depth: f32) -> f32 {
    let last = vec2i(textureDimensions(shadow_maps)) - 1;
    let seen = textureLoad(shadow_maps, clamp(texel, vec2i(0), last), layer, 0);
    return select(0.0, 1.0, depth >= seen);
}
