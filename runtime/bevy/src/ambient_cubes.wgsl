// Irradiance volume of Bevy: ambient cubes, irradiance over pi about the six axes, cd/m², times a scale. Comes after HOST_WGSL.
// One invocation computes one cell. Dispatch: ceil(cells / 4) per axis.
//
// For cells (x, y, z), the cubes are (x, 2 y, 3 z) texels: about +X, +Y and +Z one behind the other, about -X, -Y and -Z above them.

@group(0) @binding(0) var volume_0: texture_3d<f32>;
@group(0) @binding(1) var volume_y: texture_3d<f32>;
@group(0) @binding(2) var volume_z: texture_3d<f32>;
@group(0) @binding(3) var volume_x: texture_3d<f32>;
@group(0) @binding(4) var cubes: texture_storage_3d<rgba16float, write>;
// Scale over pi.
@group(0) @binding(5) var<uniform> factor: f32;

// Largest number of f16.
const LARGEST: f32 = 65504.0;

@compute @workgroup_size(4, 4, 4)
fn ambient_cubes(@builtin(global_invocation_id) cell: vec3u) {
    let size = textureDimensions(volume_0);
    if (any(cell >= size)) { return; }
    let radiance = radiance_of(vec3i(cell), vec3i(size));
    for (var axis = 0u; axis < 3u; axis += 1u) {
        for (var side = 0u; side < 2u; side += 1u) {
            var normal = vec3f(0.0);
            normal[axis] = select(1.0, -1.0, side == 1u);
            let irradiance = localprt_irradiance_from_all_around(radiance, normal);
            let texel = cell + vec3u(0u, side * size.y, axis * size.z);
            textureStore(cubes, texel, vec4f(min(irradiance * factor, vec3f(LARGEST)), 1.0));
        }
    }
}

// A cell that holds nothing takes the mean of its neighbors that do, as Bevy's filter does not leave it out.
fn radiance_of(cell: vec3i, size: vec3i) -> LocalprtRadiance {
    if (textureLoad(volume_0, cell, 0).a > 0.0) { return divided(sum_of(cell, cell)); }
    return divided(sum_of(max(cell - 1, vec3i(0)), min(cell + 1, size - 1)));
}

struct Sum {
    c0: vec4f,
    cy: vec4f,
    cz: vec4f,
    cx: vec4f,
}

fn sum_of(first: vec3i, last: vec3i) -> Sum {
    var sum: Sum;
    for (var z = first.z; z <= last.z; z += 1) {
        for (var y = first.y; y <= last.y; y += 1) {
            for (var x = first.x; x <= last.x; x += 1) {
                let at = vec3i(x, y, z);
                sum.c0 += textureLoad(volume_0, at, 0);
                sum.cy += textureLoad(volume_y, at, 0);
                sum.cz += textureLoad(volume_z, at, 0);
                sum.cx += textureLoad(volume_x, at, 0);
            }
        }
    }
    return sum;
}

fn divided(sum: Sum) -> LocalprtRadiance {
    return LocalprtRadiance(
        localprt_divide_by_coverage(sum.c0),
        localprt_divide_by_coverage(sum.cy),
        localprt_divide_by_coverage(sum.cz),
        localprt_divide_by_coverage(sum.cx),
    );
}
