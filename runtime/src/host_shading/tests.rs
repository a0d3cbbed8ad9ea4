use super::*;
use localprt_formats::directions::spherical_fibonacci;
use localprt_formats::sh::Basis;

fn direction(index: u32, count: u32) -> Vec3 {
    Vec3::from(spherical_fibonacci(index, count))
}

/// Coefficients of light from one direction that makes this irradiance on a surface facing it.
fn from_direction(dir: Vec3, irradiance: Vec3) -> RadianceDegree1 {
    let mut basis = [0.0; 4];
    Basis::new(1).evaluate(dir.to_array(), &mut basis);
    basis.map(|value| irradiance * value)
}

fn close(found: Vec3, expected: Vec3, tolerance: f32) {
    assert!(found.abs_diff_eq(expected, tolerance), "{found} instead of {expected}");
}

#[test]
fn constant_radiance_gives_pi_and_has_no_direction() {
    let color = Vec3::new(1.0, 2.0, 0.5);
    let radiance = [color * (4.0 * PI).sqrt(), Vec3::ZERO, Vec3::ZERO, Vec3::ZERO];
    for index in 0..50 {
        // A few f32 roundings of 2 pi.
        close(irradiance(&radiance, direction(index, 50)), PI * color, 4e-6);
        assert_eq!(indirect_specular(&radiance, direction(index, 50), Vec3::Y, Vec3::ONE, 0.3), Vec3::ZERO);
    }
    let light = dominant_light(&radiance);
    assert_eq!((light.dir_to_light, light.irradiance), (Vec3::ZERO, Vec3::ZERO));
    close(light.ambient, color, 1e-6);
}

#[test]
fn light_from_the_hemisphere_gives_pi_at_the_surface_and_half_at_its_edge() {
    let count = 200_000;
    for up in [Vec3::Y, Vec3::new(0.6, -0.48, 0.64)] {
        let mut radiance = [Vec3::ZERO; 4];
        for dir in (0..count).map(|index| direction(index, count)).filter(|dir| dir.dot(up) > 0.0) {
            let share = from_direction(dir, Vec3::splat(4.0 * PI / count as f32));
            radiance.iter_mut().zip(share).for_each(|(sum, value)| *sum += value);
        }
        // Sums of 10^5 f32 values and the lattice's own error of about 10^-4 at the hemisphere's edge.
        close(irradiance(&radiance, up), Vec3::splat(PI), 2e-3);
        close(irradiance(&radiance, up.any_orthonormal_vector()), Vec3::splat(PI / 2.0), 2e-3);
        close(irradiance(&radiance, -up), Vec3::ZERO, 2e-3);
        let light = dominant_light(&radiance);
        close(light.dir_to_light, up, 1e-3);
        close(light.irradiance, Vec3::splat(PI), 2e-3);
        // Scalar irradiance 2 pi less pi, over the whole sphere.
        close(light.ambient, Vec3::splat(0.25), 1e-3);
    }
}

#[test]
fn one_bright_direction_comes_back() {
    let color = Vec3::new(3.0, 1.0, 0.25);
    for index in 0..100 {
        let dir = direction(index, 100);
        let light = dominant_light(&from_direction(dir, color));
        close(light.dir_to_light, dir, 1e-6);
        close(light.irradiance, color, 2e-6);
        close(light.ambient, Vec3::ZERO, 1e-6);
        // pi Y_00^2 + 2 pi / 3 Y_1^2 = 1/4 + 1/2 of it at the light, never less than nothing behind it.
        close(irradiance(&from_direction(dir, color), dir), 0.75 * color, 2e-6);
        assert_eq!(irradiance(&from_direction(dir, color), -dir), Vec3::ZERO);
    }
}

/// A light that all normals around face: a is 0 and b is the light.
#[test]
fn the_light_of_a_receiver_comes_back() {
    let color = Vec3::new(3.0, 1.0, 0.25);
    for index in 0..100 {
        let dir = direction(index, 100);
        let surroundings = Vec3::new(0.5, 2.0, 1.0);
        let mut receiver = from_direction(dir, color / (2.0 / 3.0 * PI * SH_1 * SH_1));
        receiver[0] = surroundings / SH_0;
        let light = receiver_light(&receiver);
        close(light.dir_to_light, dir, 1e-6);
        close(light.irradiance, color, 4e-6);
        close(light.ambient, surroundings, 1e-6);
        // What the light and the surroundings give is what the receiver says.
        close(irradiance(&receiver, dir), color + PI * surroundings, 2e-5);
    }
    assert_eq!(receiver_light(&[Vec3::ZERO; 4]), DominantLight::default());
}

#[test]
fn light_from_all_around_leaves_no_dark_spot() {
    let color = Vec3::new(1.0, 2.0, 0.5);
    let constant = [color * (4.0 * PI).sqrt(), Vec3::ZERO, Vec3::ZERO, Vec3::ZERO];
    for index in 0..50 {
        let normal = direction(index, 50);
        close(irradiance_from_all_around(&constant, normal), PI * color, 8e-6);
        // One light: all of it where the normal faces it, an eighth from the side, nothing from behind.
        let light = from_direction(normal, color);
        close(irradiance_from_all_around(&light, normal), color, 8e-6);
        close(irradiance_from_all_around(&light, normal.any_orthonormal_vector()), color / 8.0, 2e-6);
        close(irradiance_from_all_around(&light, -normal), Vec3::ZERO, 1e-6);
    }
    assert_eq!(irradiance_from_all_around(&[Vec3::ZERO; 4], Vec3::Y), Vec3::ZERO);
    assert_eq!(irradiance_from_all_around(&[-Vec3::ONE, Vec3::X, Vec3::Y, Vec3::Z], Vec3::Y), Vec3::ZERO);
    // Between them, what arrives in the mean over all normals is pi Y_00 c_0, and what is behind the light is not black.
    let light = from_direction(Vec3::Y, Vec3::splat(8.0));
    let between = std::array::from_fn(|k| constant[k] + light[k]);
    let count = 20_000;
    let mean = (0..count).map(|index| irradiance_from_all_around(&between, direction(index, count))).sum::<Vec3>();
    // A smooth function on the lattice, and sums of 10^4 f32 values.
    close(mean / count as f32, PI * SH_0 * between[0], 1e-3);
    let behind = irradiance_from_all_around(&between, Vec3::NEG_Y);
    assert!(behind.cmpgt(0.4 * PI * color).all() && behind.cmple(PI * color).all(), "{behind}");
    assert!(irradiance(&between, Vec3::NEG_Y).z < 0.5 * behind.z);
}

#[test]
fn each_color_is_projected_on_the_direction_of_the_luminance() {
    let lights = [(Vec3::X, Vec3::new(4.0, 0.0, 0.0)), (Vec3::Y, Vec3::new(0.0, 4.0, 0.0))];
    let mut radiance = [Vec3::ZERO; 4];
    for (dir, color) in lights {
        radiance.iter_mut().zip(from_direction(dir, color)).for_each(|(sum, value)| *sum += value);
    }
    let light = dominant_light(&radiance);
    let expected = Vec3::new(0.2126, 0.7152, 0.0).normalize();
    close(light.dir_to_light, expected, 1e-6);
    close(light.irradiance, Vec3::new(4.0 * expected.x, 4.0 * expected.y, 0.0), 1e-5);
    close(light.ambient, (Vec3::new(4.0, 4.0, 0.0) - light.irradiance) / (4.0 * PI), 1e-6);
}

#[test]
fn specular_peaks_at_the_mirror_direction() {
    let normal = Vec3::new(0.2, 0.9, -0.3).normalize();
    let dir_to_light = Vec3::new(0.7, 0.8, 0.1).normalize();
    let mirror = 2.0 * normal.dot(dir_to_light) * normal - dir_to_light;
    for roughness in [0.0, 0.1, 0.3, 0.5] {
        let to_eye = |eye| specular(dir_to_light, Vec3::ONE, normal, eye, Vec3::splat(0.04), roughness).x;
        // D alone has its peak there; the masking shifts that of rough surfaces by less than their width.
        let count = 20_000;
        let brightest = (0..count).map(|index| direction(index, count)).filter(|dir| dir.dot(normal) > 0.0);
        let brightest = brightest.max_by(|a, b| to_eye(*a).total_cmp(&to_eye(*b))).expect("directions");
        let width = roughness * roughness;
        assert!(brightest.dot(mirror).acos() < 0.03 + width, "{roughness}: {brightest} instead of {mirror}");
        assert!(to_eye(mirror) > 0.0 && to_eye(mirror).is_finite());
    }
    assert_eq!(specular(-normal, Vec3::ONE, normal, mirror, Vec3::ONE, 0.5), Vec3::ZERO);
}

/// Integral over the hemisphere about +Y by the midpoint rule in the squared sine of the half angle and azimuth,
/// crowded toward the pole as lobes are.
fn over_hemisphere(value: impl Fn(Vec3) -> f64) -> f64 {
    let (rings, columns) = (2000, 64);
    let mut sum = 0.0;
    for ring in 0..rings {
        // cos theta = 1 - s^3, so d omega = 3 s^2 ds d phi.
        let s = (f64::from(ring) + 0.5) / f64::from(rings);
        let (cosine, weight) = (1.0 - s * s * s, 3.0 * s * s / f64::from(rings));
        let sine = (1.0 - cosine * cosine).sqrt();
        for column in 0..columns {
            let angle = (f64::from(column) + 0.5) / f64::from(columns) * std::f64::consts::TAU;
            let dir = glam::DVec3::new(sine * angle.cos(), cosine, sine * angle.sin());
            sum += value(dir.as_vec3()) * weight * std::f64::consts::TAU / f64::from(columns);
        }
    }
    sum
}

#[test]
fn microfacets_cover_the_surface_once() {
    for alpha in [0.01, 0.09, 0.25, 1.0] {
        let area = over_hemisphere(|dir| f64::from(ggx(Vec3::Y, dir, alpha)) * f64::from(dir.y));
        assert!((area - 1.0).abs() < 2e-3, "{alpha}: {area}");
    }
}

#[test]
fn no_more_is_reflected_than_arrives() {
    for roughness in [0.0, 0.2, 0.5, 0.8, 1.0] {
        for degrees in [1.0f32, 30.0, 60.0, 80.0, 89.0] {
            let eye = Vec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
            // Constant radiance 1 with a white mirror; by reciprocity also what a light's reflection takes with it.
            // Half vectors are spread evenly over their lobe, and d omega_l = 4 |h . v| d omega_h.
            let reflected = over_hemisphere(|half_dir| {
                let h_v = half_dir.dot(eye);
                let light = 2.0 * h_v * half_dir - eye;
                let value = specular(light, Vec3::ONE, Vec3::Y, eye, Vec3::ONE, roughness).x;
                f64::from(value) * 4.0 * f64::from(h_v.max(0.0))
            });
            assert!(reflected <= 1.002, "{roughness} {degrees}: {reflected}");
            // A smooth white mirror reflects nearly all.
            assert!(roughness > 0.2 || degrees > 60.0 || reflected > 0.97, "{roughness} {degrees}: {reflected}");
        }
    }
}

#[test]
fn nothing_is_infinite_at_the_edges() {
    let edge = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::new(1.0, 1e-6, 0.0).normalize()];
    for light in edge {
        for eye in edge {
            for roughness in [0.0, 1.0, f32::MAX] {
                let value = specular(light, Vec3::ONE, Vec3::Y, eye, Vec3::ONE, roughness);
                assert!(value.is_finite() && value.min_element() >= 0.0, "{light} {eye} {roughness}: {value}");
            }
        }
    }
    assert_eq!(dominant_light(&[Vec3::ZERO; 4]), DominantLight::default());
}

/// A few thousand of everything: SH radiance, normal, eye, f0 and roughness from random numbers, 20 floats each.
#[cfg(feature = "gpu")]
fn random_inputs(count: u32) -> Vec<[f32; 20]> {
    use localprt_formats::directions::counter_uniform;

    let uniform = |index: u32, dimension: u32| counter_uniform(7, u64::from(index), dimension.into()) as f32;
    let input = |index: u32| {
        let mut input: [f32; 20] = std::array::from_fn(|slot| 2.0 * uniform(index, slot as u32) - 1.0);
        // Positive in the mean, as light is.
        input[..3].iter_mut().for_each(|value| *value = 2.0 * value.abs());
        let normal = Vec3::from_slice(&input[12..15]).normalize_or(Vec3::Y);
        let eye = Vec3::from_slice(&input[15..18]).normalize_or(Vec3::Y);
        let eye = if eye.dot(normal) < 0.0 { -eye } else { eye };
        input[12..15].copy_from_slice(&normal.to_array());
        input[15..18].copy_from_slice(&eye.to_array());
        input[18..].iter_mut().for_each(|value| *value = value.abs());
        input
    };
    (0..count).map(input).collect()
}

#[cfg(feature = "gpu")]
fn results(input: &[f32; 20]) -> [Vec3; 9] {
    let color = |at: usize| Vec3::from_slice(&input[at..at + 3]);
    let radiance = [color(0), color(3), color(6), color(9)];
    let (normal, eye, f0, roughness) = (color(12), color(15), Vec3::splat(input[18]), input[19]);
    let (light, of_receiver) = (dominant_light(&radiance), receiver_light(&radiance));
    [
        irradiance(&radiance, normal),
        light.dir_to_light,
        light.irradiance,
        light.ambient,
        indirect_specular(&radiance, normal, eye, f0, roughness),
        irradiance_from_all_around(&radiance, normal),
        of_receiver.dir_to_light,
        of_receiver.irradiance,
        of_receiver.ambient,
    ]
}

#[cfg(feature = "gpu")]
#[test]
fn the_shader_computes_the_same() {
    use crate::gpu::{Groups, Kernel, readback, storage, zeros};
    use crate::test_gpu::relative_rms;

    const SHADER: &str = "
        @group(0) @binding(0) var<storage, read> inputs: array<f32>;
        @group(0) @binding(1) var<storage, read_write> results: array<vec4f>;

        fn color(at: u32) -> vec3f { return vec3f(inputs[at], inputs[at + 1u], inputs[at + 2u]); }

        @compute @workgroup_size(64)
        fn shade(@builtin(global_invocation_id) id: vec3u) {
            let at = 20u * id.x;
            let radiance = LocalprtRadiance(color(at), color(at + 3u), color(at + 6u), color(at + 9u));
            let normal = color(at + 12u);
            let light = localprt_dominant_light(radiance);
            results[9u * id.x] = vec4f(localprt_irradiance(radiance, normal), 0.0);
            results[9u * id.x + 1u] = vec4f(light.dir_to_light, 0.0);
            results[9u * id.x + 2u] = vec4f(light.irradiance, 0.0);
            results[9u * id.x + 3u] = vec4f(light.ambient, 0.0);
            let f0 = vec3f(inputs[at + 18u]);
            let specular = localprt_indirect_specular(radiance, normal, color(at + 15u), f0, inputs[at + 19u]);
            results[9u * id.x + 4u] = vec4f(specular, 0.0);
            results[9u * id.x + 5u] = vec4f(localprt_irradiance_from_all_around(radiance, normal), 0.0);
            let of_receiver = localprt_receiver_light(radiance);
            results[9u * id.x + 6u] = vec4f(of_receiver.dir_to_light, 0.0);
            results[9u * id.x + 7u] = vec4f(of_receiver.irradiance, 0.0);
            results[9u * id.x + 8u] = vec4f(of_receiver.ambient, 0.0);
        }";
    let Some((device, queue)) = crate::test_gpu::device("the_shader_computes_the_same") else { return };
    let inputs = random_inputs(4096);
    let kernel = Kernel::new(&device, "shade", &[crate::HOST_WGSL, SHADER].concat(), &[]);
    let buffer = storage(&device, "host_shading.inputs", bytemuck::cast_slice(inputs.as_flattened()));
    let results_buffer = zeros(&device, "host_shading.results", inputs.len() as u64 * 144);
    let bindings = kernel.bind(&device, &[buffer.as_entire_binding(), results_buffer.as_entire_binding()]);
    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernel.dispatch(&mut pass, &bindings, Groups::new(&device, inputs.len() as u64 / 64));
    }
    queue.submit([encoder.finish()]);
    let bytes = readback::buffer(&device, &queue, &results_buffer).expect("results");
    let found: Vec<Vec3> = bytes.chunks_exact(16).map(|value| bytemuck::pod_read_unaligned(&value[..12])).collect();
    let expected: Vec<[Vec3; 9]> = inputs.iter().map(results).collect();
    let names = ["irradiance", "direction", "light", "ambient", "specular", "all around"];
    for (output, name) in names.into_iter().chain(["its direction", "its light", "its ambient"]).enumerate() {
        let found: Vec<Vec3> = found.iter().skip(output).step_by(9).copied().collect();
        let expected: Vec<Vec3> = expected.iter().map(|outputs| outputs[output]).collect();
        let error = relative_rms(&found, &expected);
        eprintln!("{name}: relative RMS {error:.1e}");
        // f32 roundings, up to some ten in a row, and peaks at roughness 0.1, which magnify them by 1 / (2 alpha) = 50.
        assert!(error <= 1e-5, "{name}: {error}");
    }
}
