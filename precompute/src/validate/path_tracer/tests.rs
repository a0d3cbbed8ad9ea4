//! The path tracer against closed forms, and against itself.

use super::*;
use crate::progress::Progress;
use glam::{DVec3, Vec4};
use localprt_scenes::builtin::{FURNACE_ALBEDO, FURNACE_EMISSION, furnace_irradiance};
use localprt_scenes::{AlphaMode, Light, LightKind, Material, Mesh, Scene, Sky, builtin, luminance};
use std::f64::consts::PI as PI64;

const UP: SurfacePoint = SurfacePoint { position: Vec3::ZERO, normal: Vec3::Y, geometric_normal: Vec3::Y };
/// Facing down, one meter up.
const DOWN: SurfacePoint = SurfacePoint { position: Vec3::Y, normal: Vec3::NEG_Y, geometric_normal: Vec3::NEG_Y };

fn estimate(scene: &Scene, lighting: &Lighting, bounces: u32, points: &[SurfacePoint], paths: u32) -> Estimates {
    with_seed(scene, lighting, bounces, points, paths, 1)
}

fn with_seed(
    scene: &Scene,
    lighting: &Lighting,
    bounces: u32,
    points: &[SurfacePoint],
    paths: u32,
    seed: u64,
) -> Estimates {
    let caster = RayCaster::new(scene).expect("a tree");
    let tracer = PathTracer::new(&caster, lighting, bounces, seed);
    let budget = PathBudget { error: 0.0, most_paths: paths };
    tracer.estimate(points, budget, &Progress::silent()).expect("not cancelled")
}

/// Every band within three standard errors; `rounding` is what f32 sums and the polygons of a shape may add, relative.
fn assert_agrees(estimates: &Estimates, expected: f64, rounding: f64) {
    assert!(!estimates.irradiance.is_empty());
    for (value, error) in estimates.irradiance.iter().zip(&estimates.standard_error) {
        let allowed = 3.0 * f64::from(error.x) + rounding * expected;
        assert!((f64::from(value.x) - expected).abs() <= allowed, "{value} +- {error}, not {expected}");
        // An estimate that knows nothing would pass any test.
        assert!(f64::from(error.x) <= 0.01 * expected, "{value} +- {error}");
    }
}

/// Points on the inner faces of a box of half size 1 about (0, 1, 0).
fn box_points() -> Vec<SurfacePoint> {
    let faces = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let point = |(i, normal): (usize, Vec3)| {
        let (tangent, bitangent) = frame(normal);
        let shift = tangent * (0.15 * i as f32 - 0.4) + bitangent * (0.83 - 0.2 * i as f32);
        SurfacePoint { position: Vec3::Y - normal + shift, normal, geometric_normal: normal }
    };
    faces.into_iter().enumerate().map(point).collect()
}

fn horizontal(name: &str, corners: [Vec3; 4], material: usize) -> Mesh {
    Mesh {
        name: name.into(),
        normals: vec![(corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize(); 4],
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material,
        ..Mesh::default()
    }
}

/// A square about the y axis that faces up or down.
fn square(half: f32, height: f32, up: bool) -> [Vec3; 4] {
    let corners = [(-half, -half), (-half, half), (half, half), (half, -half)].map(|(x, z)| Vec3::new(x, height, z));
    if up { corners } else { [corners[3], corners[2], corners[1], corners[0]] }
}

fn gray(albedo: f32, emission: f32) -> Material {
    Material {
        base_color: Vec4::new(albedo, albedo, albedo, 1.0),
        emission: Vec3::splat(emission),
        ..Material::default()
    }
}

/// Form factor of a polygon seen from a point, by Lambert's contour formula: sum of angles times their axes.
fn form_factor(point: Vec3, normal: Vec3, polygon: &[Vec3]) -> f64 {
    let rays: Vec<DVec3> = polygon.iter().map(|corner| (*corner - point).as_dvec3().normalize()).collect();
    let sum: f64 = (0..rays.len())
        .map(|i| {
            let (a, b) = (rays[i], rays[(i + 1) % rays.len()]);
            let cross = a.cross(b);
            cross.length().atan2(a.dot(b)) * cross.normalize().dot(normal.as_dvec3())
        })
        .sum();
    sum.abs() / (2.0 * PI64)
}

#[test]
fn a_glowing_box_follows_its_series() {
    let scene = builtin::scene("furnace").expect("built in");
    let lighting = Lighting::of_scene(&scene);
    for bounces in [1, 2, 5] {
        let estimates = estimate(&scene, &lighting, bounces, &box_points(), 8192);
        assert_agrees(&estimates, furnace_irradiance(Some(bounces)), 1e-6);
    }
    // Russian roulette alone ends these paths.
    assert_agrees(&estimate(&scene, &lighting, 1000, &box_points(), 16_384), furnace_irradiance(None), 1e-6);
}

#[test]
fn a_glowing_sphere_is_a_furnace_whatever_its_polygons() {
    let mut scene = builtin::scene("sphere").expect("built in");
    scene.materials[0] = gray(FURNACE_ALBEDO, FURNACE_EMISSION);
    let lighting = Lighting { lights: vec![], ..Lighting::of_scene(&scene) };
    // Two facets.
    let points: Vec<SurfacePoint> = [5, 3000]
        .map(|triangle| {
            let [a, b, c] = scene.corners(0, triangle);
            let normal = scene.geometric_normal(0, triangle);
            SurfacePoint { position: (a + b + c) / 3.0, normal, geometric_normal: normal }
        })
        .to_vec();
    assert_agrees(&estimate(&scene, &lighting, 3, &points, 8192), furnace_irradiance(Some(3)), 1e-5);
}

#[test]
fn a_lit_square_shines_by_its_form_factor() {
    // The sun puts 5 lux on a floor of albedo 0.6: radiance 3 / pi, seen from one meter above and askew.
    let scene = Scene {
        meshes: vec![horizontal("floor", square(1.5, 0.0, true), 0)],
        materials: vec![gray(0.6, 0.0)],
        ..Scene::default()
    };
    let sun = Light {
        name: "sun".into(),
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::NEG_Y,
        color: Vec3::ONE,
        intensity: 5.0,
        range: None,
    };
    let lighting = Lighting { lights: vec![sun], ..Lighting::default() };
    let askew = Vec3::new(0.3, -1.0, 0.2).normalize();
    for normal in [Vec3::NEG_Y, askew] {
        let point = SurfacePoint { position: Vec3::new(0.2, 1.0, -0.1), normal, geometric_normal: normal };
        // The horizon of the tilted normal lies above the square as far as it reaches.
        let expected = 0.6 * 5.0 * form_factor(point.position, normal, &square(1.5, 0.0, true));
        assert_agrees(&estimate(&scene, &lighting, 1, &[point], 16_384), expected, 1e-5);
    }
}

#[test]
fn a_glowing_disc_shines_by_its_form_factor() {
    // E = pi L R^2 / (R^2 + h^2) for a disc of radius R at distance h. A small and a large one: sampling of the emitter
    // wins for one, sampling by the cosine for the other.
    const N: u32 = 128;
    for radius in [0.1f32, 2.0] {
        let rim: Vec<Vec3> = (0..N)
            .map(|i| {
                let (sin, cos) = (std::f32::consts::TAU * i as f32 / N as f32).sin_cos();
                Vec3::new(radius * cos, 1.0, radius * sin)
            })
            .collect();
        let mut disc = Mesh { normals: vec![Vec3::NEG_Y; N as usize + 1], ..Mesh::default() };
        disc.triangles = (0..N).map(|i| [N, i, (i + 1) % N]).collect();
        disc.positions = rim.iter().copied().chain([Vec3::Y]).collect();
        let scene = Scene { meshes: vec![disc], materials: vec![gray(0.0, 3.0)], ..Scene::default() };
        assert!(scene.geometric_normal(0, 0).y < 0.0, "the disc faces down");
        let squared = f64::from(radius) * f64::from(radius);
        let expected = PI64 * 3.0 * squared / (squared + 1.0);
        // The polygon is 2 pi^2 / 3 n^2 = 4e-4 smaller than the disc.
        assert!((PI64 * 3.0 * form_factor(Vec3::ZERO, Vec3::Y, &rim) / expected - 1.0).abs() < 4.1e-4);
        assert_agrees(&estimate(&scene, &Lighting::default(), 1, &[UP], 16_384), expected, 4.1e-4);
        // Its back is dark.
        let above = SurfacePoint { position: Vec3::Y * 2.0, ..DOWN };
        assert_eq!(estimate(&scene, &Lighting::default(), 1, &[above], 512).irradiance[0], Vec3::ZERO);
    }
}

#[test]
fn the_sky_arrives_where_masks_have_holes() {
    let lid = |alpha: f32, mode| {
        let material = Material {
            base_color: Vec4::new(0.0, 0.0, 0.0, alpha),
            alpha: mode,
            double_sided: true,
            ..Material::default()
        };
        Scene {
            meshes: vec![horizontal("lid", square(0.5, 0.5, false), 0)],
            materials: vec![material],
            ..Scene::default()
        }
    };
    let lighting = Lighting { sky: Sky::Constant(Vec3::splat(2.0)), ..Lighting::default() };
    let covered = form_factor(Vec3::ZERO, Vec3::Y, &square(0.5, 0.5, false));
    for (alpha, mode, open) in [
        (0.4, AlphaMode::Mask { cutoff: 0.5 }, 1.0),
        (0.6, AlphaMode::Mask { cutoff: 0.5 }, 1.0 - covered),
        (0.4, AlphaMode::Opaque, 1.0 - covered),
        (0.4, AlphaMode::Blend, 1.0),
    ] {
        let estimates = estimate(&lid(alpha, mode), &lighting, 1, &[UP], 16_384);
        assert_agrees(&estimates, 2.0 * PI64 * open, 1e-5);
    }
}

#[test]
fn many_lights_give_what_all_of_them_give() {
    // The same irradiance from one light and from twenty that share its intensity, which are drawn and not all asked.
    let scene = builtin::scene("cornell").expect("built in");
    let one = Lighting::of_scene(&scene);
    let mut lights = Vec::new();
    for share in 1..=20 {
        // Unequal shares that add up to 1, and as many lights again that do not reach anything.
        lights.push(Light { intensity: one.lights[0].intensity * share as f32 / 210.0, ..one.lights[0].clone() });
        lights.push(Light { range: Some(1e-3), ..one.lights[0].clone() });
    }
    let many = Lighting { lights, ..one.clone() };
    let floor = SurfacePoint { position: Vec3::new(0.7, 0.0, 0.8), ..UP };
    let exact = estimate(&scene, &one, 2, &[floor], 65_536);
    let drawn = with_seed(&scene, &many, 2, &[floor], 65_536, 2);
    let allowed = 3.0 * exact.standard_error[0].length().hypot(drawn.standard_error[0].length());
    assert!(exact.irradiance[0].distance(drawn.irradiance[0]) < allowed, "{exact:?} {drawn:?}");
    assert!(allowed < 0.03 * exact.irradiance[0].length());
}

#[test]
fn a_sun_in_a_sky_image_is_found() {
    // One bright pixel of 512 x 256 in a dim sky: E = pi on the plane from the rest, and the pixel's light times its cosine.
    let (width, height) = (512, 256);
    let (column, row) = (100, 60);
    let mut pixels = vec![Vec3::ONE; width * height];
    // Bilinear filtering spreads a pixel over its neighbors and keeps its integral but for the change of the cosine.
    let polar = (row as f64 + 0.5) / height as f64 * PI64;
    let solid_angle = (PI64 / height as f64) * (2.0 * PI64 / width as f64) * polar.sin();
    pixels[row * width + column] = Vec3::splat(1.0 + 50_000.0);
    let sky = Sky::Equirect { width: width as u32, height: height as u32, pixels, scale: 1.0, rotation: 30.0 };
    let lighting = Lighting { sky, ..Lighting::default() };
    let scene = Scene {
        // Far below, so that the scene has a surface.
        meshes: vec![horizontal("floor", square(0.5, -5.0, true), 0)],
        materials: vec![gray(0.0, 0.0)],
        ..Scene::default()
    };
    let expected = PI64 + 50_000.0 * solid_angle * polar.cos();
    let estimates = estimate(&scene, &lighting, 1, &[UP], 65_536);
    // The two pixels across which the sun spreads: (pi / 256)^2 / 4 of the second derivative, 4e-5.
    assert_agrees(&estimates, expected, 1e-4);
    // And where it was put: column 100.5 turned back by 30 degrees.
    let azimuth = 100.5 / 512.0 * 2.0 * PI64 - 30f64.to_radians();
    let toward = DVec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos()).as_vec3();
    let away = SurfacePoint { normal: -toward, geometric_normal: -toward, ..UP };
    let estimates = estimate(&scene, &lighting, 1, &[away], 65_536);
    // The floor hides 1 m^2 in 25 of what is behind.
    assert!(estimates.irradiance[0].x < 3.2, "{estimates:?}");
}

#[test]
fn sampling_until_an_error_is_reached_keeps_the_mean() {
    // Twelve lamps of which one is close to the ceiling: a bright spot, drawn lights, paths that few points meet early.
    let scene = builtin::scene("cornell").expect("built in");
    let own = Lighting::of_scene(&scene);
    let mut lights = vec![own.lights[0].clone(); 12];
    for (index, light) in lights.iter_mut().enumerate() {
        light.intensity = 0.05;
        light.position = Vec3::new(0.15 * index as f32 - 0.8, 1.0, 0.5);
    }
    lights[0].position = Vec3::new(0.1, 1.98, 0.1);
    lights[0].intensity = 1.0;
    let lighting = Lighting { lights, ..own };
    let caster = RayCaster::new(&scene).expect("a tree");
    let points: Vec<SurfacePoint> =
        (0..64).map(|i| SurfacePoint { position: Vec3::new(0.025 * i as f32 - 0.8, 0.0, 0.9), ..UP }).collect();
    let mean = |seed: u64, budget: PathBudget| {
        let tracer = PathTracer::new(&caster, &lighting, 2, seed);
        let estimates = tracer.estimate(&points, budget, &Progress::silent()).expect("not cancelled");
        estimates.irradiance.iter().map(|value| f64::from(value.y)).sum::<f64>() / points.len() as f64
    };
    let fixed = mean(1000, PathBudget { error: 0.0, most_paths: 32_768 });
    let n = 24u32;
    let adaptive: Vec<f64> =
        (0..n).map(|seed| mean(seed.into(), PathBudget { error: 0.03, most_paths: 32_768 })).collect();
    let average = adaptive.iter().sum::<f64>() / f64::from(n);
    let spread = (adaptive.iter().map(|value| (value - average).powi(2)).sum::<f64>() / f64::from(n * (n - 1))).sqrt();
    // Three standard errors of the average, and as much for the fixed one, which has more paths than any.
    assert!((average - fixed).abs() < 6.0 * spread.max(1e-4 * fixed), "{average} +- {spread}, {fixed}");
    assert!(spread < 0.005 * fixed, "{spread}");
}

#[test]
fn a_lamp_flush_with_a_ceiling_shines() {
    let scene = builtin::scene("cornell").expect("built in");
    let own = Lighting::of_scene(&scene);
    let at = |height: f32| {
        let mut lighting = own.clone();
        lighting.lights[0].position = Vec3::new(0.1, height, 0.2);
        let floor = SurfacePoint { position: Vec3::new(0.7, 0.0, 0.8), ..UP };
        let estimates = estimate(&scene, &lighting, 1, &[floor], 16_384);
        (f64::from(estimates.irradiance[0].y), f64::from(estimates.standard_error[0].y))
    };
    let ((flush, flush_error), (below, below_error)) = (at(2.0), at(1.999));
    // A millimetre makes a difference of a few thousandths of the light.
    assert!((flush - below).abs() < 3.0 * flush_error.hypot(below_error) + 0.005 * below, "{flush} {below}");
}

#[test]
fn two_seeds_agree_within_their_standard_errors() {
    let scene = builtin::scene("cornell").expect("built in");
    let lighting = Lighting::of_scene(&scene);
    let points: Vec<SurfacePoint> = (0..400)
        .map(|i| {
            let place = |axis| counter_uniform(5, i, axis) as f32 * 1.8 - 0.9;
            if i % 2 == 0 {
                SurfacePoint { position: Vec3::new(place(0), 2.0, place(1)), ..DOWN }
            } else {
                SurfacePoint {
                    position: Vec3::new(-1.0, 1.0 + place(0), place(1)),
                    normal: Vec3::X,
                    geometric_normal: Vec3::X,
                }
            }
        })
        .collect();
    let [a, b] = [1, 2].map(|seed| with_seed(&scene, &lighting, 2, &points, 64 * 32, seed));
    let mut squares = 0.0;
    let mut far = 0;
    for i in 0..points.len() {
        let error = a.standard_error[i].y.hypot(b.standard_error[i].y);
        let z = f64::from((a.irradiance[i].y - b.irradiance[i].y) / error);
        squares += z * z;
        far += u32::from(z.abs() > 3.0);
    }
    // 32 batches each: z is nearly a t variable with some 60 degrees of freedom, variance 62 / 60; over 400 points its
    // mean square has a standard error of sqrt(2 / 400) = 0.07. Five of them, and 5 of 400 beyond three.
    let mean_square = squares / points.len() as f64;
    assert!((mean_square - 62.0 / 60.0).abs() < 0.35, "{mean_square}");
    assert!(far <= 5, "{far}");
    // The same seed gives the same bits, whatever else is in the list.
    let alone = with_seed(&scene, &lighting, 2, &points[..1], 64 * 32, 1);
    assert_eq!(alone.irradiance[0], a.irradiance[0]);
}

#[test]
fn sampling_stops_at_the_error_asked_for() {
    let scene = builtin::scene("cornell").expect("built in");
    let lighting = Lighting::of_scene(&scene);
    let caster = RayCaster::new(&scene).expect("a tree");
    let tracer = PathTracer::new(&caster, &lighting, 1, 3);
    let points: Vec<SurfacePoint> =
        (0..16).map(|i| SurfacePoint { position: Vec3::new(0.1 * i as f32 - 0.8, 0.0, 0.9), ..UP }).collect();
    let budget = PathBudget { error: 0.02, most_paths: 1 << 16 };
    let estimates = tracer.estimate(&points, budget, &Progress::silent()).expect("not cancelled");
    let mean = estimates.irradiance.iter().map(|value| luminance(*value)).sum::<f64>() / points.len() as f64;
    for (error, paths) in estimates.standard_error.iter().zip(&estimates.paths) {
        assert!(luminance(*error) <= 0.02 * mean, "{error} after {paths}");
        assert!((512..1 << 16).contains(paths));
    }
    let progress = Progress::silent();
    progress.cancel();
    assert!(tracer.estimate(&points, budget, &progress).is_err());
}

#[test]
fn a_picture_of_a_furnace_is_uniform() {
    let scene = builtin::scene("furnace").expect("built in");
    let lighting = Lighting::of_scene(&scene);
    let caster = RayCaster::new(&scene).expect("a tree");
    let tracer = PathTracer::new(&caster, &lighting, 2, 3);
    let settings = ViewSettings { width: 8, height: 6, rays_per_axis: 2, paths: 2048 };
    let view = tracer.view(&scene.cameras[0], settings, &Progress::silent()).expect("not cancelled");
    let picture = view.picture(|light| light.radiance(light.reference()));
    // Le (1 + a + a^2).
    let expected = FURNACE_EMISSION * (1.0 + FURNACE_ALBEDO + FURNACE_ALBEDO * FURNACE_ALBEDO);
    for pixel in &picture.pixels {
        // 4 x 2048 paths of a relative deviation of about 0.5: a standard error of 0.6 %, five of them.
        assert!((pixel.x / expected - 1.0).abs() < 0.03, "{pixel}");
    }
    let mean = picture.pixels.iter().map(|pixel| f64::from(pixel.x)).sum::<f64>() / 48.0;
    assert!((mean / f64::from(expected) - 1.0).abs() < 0.004, "{mean}");
}
