//! Light about the normals of normal maps.

use glam::{Affine2, Vec2, Vec3, Vec4Swizzles};
use localprt_precompute::{
    BakeOutput, BakeSettings, Progress,
    metrics::MethodError,
    picture::camera_dir,
    rays::{RayCaster, SurfaceHit},
    validate::path_tracer::{PathBudget, PathTracer},
};
use localprt_scenes::{Image, Lighting, Scene, Sky, SurfacePoint, Texture, TextureRef, Wrap};
use localprt_tests::{bake, relit, scene, small_settings};
use std::f32::consts::PI;

fn of_degree(receiver_degree: u32) -> BakeSettings {
    BakeSettings { receiver_degree, ..small_settings() }
}

/// A point of a baked scene as a camera sees it, and where the lightmap holds its light.
fn seen(scene: &Scene, hit: &SurfaceHit) -> Option<(SurfacePoint, Vec2)> {
    let face = hit.point?;
    let mesh = &scene.meshes[face.mesh];
    let [a, b, c] = mesh.triangles[face.triangle].map(|vertex| mesh.lightmap_uv().map(|set| set[vertex as usize]));
    let uv = a? * face.barycentrics.x + b? * face.barycentrics.y + c? * face.barycentrics.z;
    Some((hit.mapped_point(scene), uv))
}

/// Irradiance of the file about the points' normals.
fn read(baked: &BakeOutput, lighting: &Lighting, points: &[(SurfacePoint, Vec2)]) -> Vec<Vec3> {
    relit(baked, lighting, 1, |relighter| {
        let maps = &relighter.relit().maps;
        let at = |(point, uv): &(SurfacePoint, Vec2)| maps.irradiance_about(point.normal, |map| map.sample(*uv));
        points.iter().map(|point| at(point).unwrap_or_default()).collect()
    })
}

/// `plane` with a normal map that leans all of it toward +x.
fn leaning_plane() -> Scene {
    let mut scene = scene("plane");
    scene.textures = vec![Texture { image: 0, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, nearest: false }];
    scene.images =
        vec![Image { name: "lean".into(), width: 1, height: 1, rgba: vec![200, 128, 228, 255], encoded: None }];
    for material in &mut scene.materials {
        material.normal_texture = Some(TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY });
    }
    for mesh in &mut scene.meshes {
        mesh.uv_sets = vec![mesh.positions.iter().map(|position| Vec2::new(position.x, position.z)).collect()];
    }
    scene
}

/// Under a constant sky L, a normal that leans by an angle has the irradiance pi L (1 + cos) / 2 above the surface's horizon: a + b·n, so that
/// the file holds it exactly, and the path tracer finds it.
#[test]
fn a_leaning_normal_sees_the_sky_above_the_horizon() {
    let baked = bake(leaning_plane(), &of_degree(1));
    let sky = Vec3::new(0.5, 1.0, 2.0);
    let lighting = Lighting { sky: Sky::Constant(sky), ..Lighting::default() };
    let caster = RayCaster::new(&baked.scene).expect("a tree");
    let points: Vec<_> = (0..9)
        .filter_map(|i| {
            let eye = Vec3::new((i % 3) as f32 - 1.0, 1.0, (i / 3) as f32 - 1.0);
            seen(&baked.scene, &caster.closest_hit(eye, Vec3::NEG_Y)?)
        })
        .collect();
    assert_eq!(points.len(), 9);
    let cosine = points[0].0.normal.y;
    assert!((0.75..0.85).contains(&cosine) && points[0].0.normal.x > 0.5, "{}", points[0].0.normal);
    let expected = PI * sky * (1.0 + cosine) / 2.0;
    let surface: Vec<SurfacePoint> = points.iter().map(|(point, _)| *point).collect();
    let tracer = PathTracer::new(&caster, &lighting, 1, 5);
    let traced = tracer.estimate(&surface, PathBudget::default(), &Progress::silent()).expect("not cancelled");
    for (found, reference) in read(&baked, &lighting, &points).into_iter().zip(traced.irradiance) {
        // 256 gather rays over the hemisphere, and f16.
        assert!((found / expected - Vec3::ONE).abs().max_element() < 0.01, "{found}, not {expected}");
        // Four standard errors of 1 %.
        assert!((reference / expected - Vec3::ONE).abs().max_element() < 0.04, "{reference}, not {expected}");
    }
}

/// The wall of bricks, lit from one side: with degree 1 the file follows the bumps, and is as right in the mean as with degree 0.
#[test]
fn degree_1_follows_the_bumps_of_a_wall() {
    let error = |degree: u32| {
        let baked = bake(scene("bricks"), &of_degree(degree));
        let lighting = Lighting::of_scene(&baked.scene);
        let caster = RayCaster::new(&baked.scene).expect("a tree");
        let camera = baked.scene.cameras.iter().find(|camera| camera.name == "wall").expect("a camera");
        let pixel = |i: u32| {
            let (u, v) = ((i % 20) as f32 + 0.5, (i / 20) as f32 + 0.5);
            let dir = camera_dir(camera, u / 20.0, v / 15.0, 4.0 / 3.0);
            seen(&baked.scene, &caster.closest_hit(camera.to_world.w_axis.xyz(), dir)?)
        };
        let points: Vec<_> = (0..300).filter_map(pixel).collect();
        let surface: Vec<SurfacePoint> = points.iter().map(|(point, _)| *point).collect();
        let tracer = PathTracer::new(&caster, &lighting, 1, 5);
        let traced = tracer.estimate(&surface, PathBudget::default(), &Progress::silent()).expect("not cancelled");
        MethodError::of(&read(&baked, &lighting, &points), &traced.irradiance).expect("light")
    };
    let [flat, bumpy] = [0, 1].map(error);
    eprintln!("degree 0: nrmse {}, bias {}; degree 1: {}, {}", flat.nrmse, flat.bias, bumpy.nrmse, bumpy.bias);
    // Projected radiance, a tenth too dark, was as far off as degree 0 is. Half leaves room for few probes and large texels.
    assert!(bumpy.nrmse < 0.5 * flat.nrmse, "{} {}", bumpy.nrmse, flat.nrmse);
    assert!(bumpy.bias.abs() < 0.03, "{}", bumpy.bias);
}
