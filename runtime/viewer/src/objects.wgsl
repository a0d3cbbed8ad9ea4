// Objects that move: emission, direct light with shadow maps, indirect light from the volume per pixel or from the probes
// per object.
// Draw: indexed, one draw per object, whose number is the instance. Follows scene_draw.wgsl; its group 2 is another one
// than that of surfaces.

struct Object {
    to_world: mat4x4f,
    albedo: vec4f,
    emission: vec4f,
}

struct ObjectLight {
    // Position of the volume's first cell, metres.
    origin: vec3f,
    // Distance of cells, metres; 0 if there is no volume.
    spacing_m: f32,
    // Cells per axis.
    size: vec3f,
    n_probes: u32,
    // SH functions per probe.
    n_sh: u32,
}

@group(1) @binding(5) var<storage, read> objects: array<Object>;

@group(2) @binding(0) var<uniform> object_light: ObjectLight;
// Position and support radius, metres.
@group(2) @binding(1) var<storage, read> probes: array<vec4f>;
// [n_probes, n_sh], RGB0.
@group(2) @binding(2) var<storage, read> probe_radiance: array<vec4f>;
// Coefficient times weight, weight.
@group(2) @binding(3) var volume_0: texture_3d<f32>;
@group(2) @binding(4) var volume_y: texture_3d<f32>;
@group(2) @binding(5) var volume_z: texture_3d<f32>;
@group(2) @binding(6) var volume_x: texture_3d<f32>;

struct ObjectVertex {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) @interpolate(flat) object: u32,
    // SH radiance about the object's center, from the probes.
    @location(3) @interpolate(flat) c0: vec3f,
    @location(4) @interpolate(flat) cy: vec3f,
    @location(5) @interpolate(flat) cz: vec3f,
    @location(6) @interpolate(flat) cx: vec3f,
}

@vertex
fn object_vertex(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @builtin(instance_index) index: u32,
) -> ObjectVertex {
    let to_world = objects[index].to_world;
    let world = to_world * vec4f(position, 1.0);
    // The inverse transpose, times the determinant.
    let cofactors = mat3x3f(
        cross(to_world[1].xyz, to_world[2].xyz),
        cross(to_world[2].xyz, to_world[0].xyz),
        cross(to_world[0].xyz, to_world[1].xyz),
    );
    var light = LocalprtRadiance(vec3f(0.0), vec3f(0.0), vec3f(0.0), vec3f(0.0));
    if (object_light.spacing_m == 0.0) { light = radiance_of_probes(to_world[3].xyz); }
    let clip = frame.world_to_clip * world;
    return ObjectVertex(clip, world.xyz, cofactors * normal, index, light.c0, light.cy, light.cz, light.cx);
}

@fragment
fn object_fragment(in: ObjectVertex) -> @location(0) vec4f {
    let albedo = objects[in.object].albedo.rgb;
    let emission = objects[in.object].emission.rgb;
    let normal = normalize(in.normal);
    var radiance = LocalprtRadiance(in.c0, in.cy, in.cz, in.cx);
    if (object_light.spacing_m > 0.0) { radiance = radiance_of_volume(in.position); }
    let direct = direct_light(in.position, normal, normal, normalize(frame.eye - in.position), 1.0);
    var indirect = localprt_irradiance_from_all_around(radiance, normal);
    if (in.clip.x >= frame.split_px && other.kind != OTHER_MAP) {
        indirect = other_irradiance_anywhere(in.position, normal, normalize(frame.eye - in.position));
    }
    return vec4f(min(viewed(emission, albedo, direct.irradiance, indirect, vec3f(0.0)), vec3f(LARGEST)), 1.0);
}

// Trilinear; dark where no cell around holds light. Places outside of the grid count as on its border.
fn radiance_of_volume(position: vec3f) -> LocalprtRadiance {
    let at = ((position - object_light.origin) / object_light.spacing_m + 0.5) / object_light.size;
    return LocalprtRadiance(
        localprt_divide_by_coverage(textureSampleLevel(volume_0, map_sampler, at, 0.0)),
        localprt_divide_by_coverage(textureSampleLevel(volume_y, map_sampler, at, 0.0)),
        localprt_divide_by_coverage(textureSampleLevel(volume_z, map_sampler, at, 0.0)),
        localprt_divide_by_coverage(textureSampleLevel(volume_x, map_sampler, at, 0.0)),
    );
}

// Mean of the probes whose support holds a point, by the weight kernel of Eq. (10), which knows no walls; dark outside of
// every support.
fn radiance_of_probes(position: vec3f) -> LocalprtRadiance {
    var sum = LocalprtRadiance(vec3f(0.0), vec3f(0.0), vec3f(0.0), vec3f(0.0));
    var weights = 0.0;
    for (var probe = 0u; probe < object_light.n_probes; probe++) {
        let t = distance(probes[probe].xyz, position) / probes[probe].w;
        // Not a number either, for a support without size.
        if (!(t < 1.0)) { continue; }
        let weight = t * t * (2.0 * t - 3.0) + 1.0;
        let first = probe * object_light.n_sh;
        weights += weight;
        sum.c0 += weight * probe_radiance[first].rgb;
        if (object_light.n_sh >= 4u) {
            sum.cy += weight * probe_radiance[first + 1u].rgb;
            sum.cz += weight * probe_radiance[first + 2u].rgb;
            sum.cx += weight * probe_radiance[first + 3u].rgb;
        }
    }
    let scale = select(0.0, 1.0 / weights, weights > 0.0);
    return LocalprtRadiance(sum.c0 * scale, sum.cy * scale, sum.cz * scale, sum.cx * scale);
}
