//! A ball without a light map in the light of the volume, held against the relighter on the CPU.

use crate::stage::{EXPOSURE, Stage, save};
use bevy::prelude::*;
use bevy_localprt::{Relit, SkyRadiance};
use localprt_formats::Baked;
use localprt_runtime::CpuRelighter;
use localprt_runtime::host_shading::irradiance_from_all_around;
use localprt_scenes::{Lighting, Sky, linear_to_srgb};
use std::f32::consts::PI;
use std::path::Path;

const GATHERS: u32 = 8;
const CENTER: Vec3 = Vec3::new(-0.45, 0.6, 0.7);
const RADIUS_M: f32 = 0.16;
const ALBEDO: f32 = 0.5;
/// Nothing but a sky, whose light reaches the ball through the volume alone.
const SKY: Vec3 = Vec3::new(0.1, 0.2, 0.4);
/// Cosine to the eye below which a pixel may be of the edge.
const LEAST_COSINE: f32 = 0.3;
/// Mean difference of 255: pictures have whole steps, and textures are filtered by eight bits of a place.
const ALLOWED: f32 = 1.0;

pub fn ball(mut stage: Stage, file: &Path, out: &Path) -> Result<(), String> {
    stage.change::<Relit>(stage.root, |relit| relit.sky = SkyRadiance::constant(SKY));
    stage.change::<Visibility>(stage.lamp, |visibility| *visibility = Visibility::Hidden);
    let world = stage.app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Sphere::new(RADIUS_M).mesh().uv(128, 64));
    let gray = StandardMaterial {
        base_color: Color::linear_rgb(ALBEDO, ALBEDO, ALBEDO),
        reflectance: 0.0,
        perceptual_roughness: 1.0,
        ..default()
    };
    let gray = world.resource_mut::<Assets<StandardMaterial>>().add(gray);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(gray), Transform::from_translation(CENTER)));
    stage.draw_anew(GATHERS)?;
    let picture = stage.picture();
    save(&picture, out, "ball")?;

    let said = |error: &dyn std::error::Error| error.to_string();
    let baked = Baked::open(file).map_err(|error| said(&error))?;
    let scene = localprt_scenes::load(file.with_extension("glb")).map_err(|error| said(&error))?;
    let mut relighter = CpuRelighter::new(baked.checked().map_err(|error| said(&error))?);
    let sky = Sky::Constant(glam::Vec3::from_array(SKY.to_array()));
    relighter.set_scene(&scene).map_err(|error| said(&error))?;
    relighter.set_lighting(&Lighting { sky, ..Lighting::default() }).map_err(|error| said(&error))?;
    for _ in 0..GATHERS {
        relighter.bounce().map_err(|error| said(&error))?;
    }
    let volume = relighter.volume_sampler().ok_or("the file has no volume")?;
    let shown = |place: Vec3, normal: Vec3| -> Option<Vec3> {
        let radiance = volume.radiance_at(glam::Vec3::from_array(place.to_array()))?;
        let of_degree_1 = radiance.first_chunk()?;
        let along = |axis: usize| {
            let side = glam::Vec3::AXES[axis] * normal[axis].signum();
            irradiance_from_all_around(of_degree_1, side) * normal[axis].powi(2)
        };
        // What an ambient cube is between its axes.
        let irradiance: glam::Vec3 = (0..3).map(along).sum();
        let radiance = irradiance * (ALBEDO / PI * EXPOSURE);
        Some(Vec3::from_array(radiance.to_array().map(|band| f32::from(linear_to_srgb(band)))))
    };

    let world = stage.app.world();
    let camera = world.get::<Camera>(stage.camera).ok_or("the camera is gone")?;
    let eye = world.get::<GlobalTransform>(stage.camera).ok_or("the camera is nowhere")?;
    let (mut n_pixels, mut difference, mut turned) = (0, 0.0, 0.0);
    for y in 0..picture.height() {
        for x in 0..picture.width() {
            let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let ray = camera.viewport_to_world(eye, at).map_err(|error| format!("{error:?}"))?;
            let Some(place) = on_ball(ray) else { continue };
            let normal = (place - CENTER) / RADIUS_M;
            if normal.dot(-*ray.direction) < LEAST_COSINE {
                continue;
            }
            let color = picture.get_color_at(x, y).map_err(|error| error.to_string())?.to_srgba();
            let found = 255.0 * Vec3::new(color.red, color.green, color.blue);
            let mean = |expected: Option<Vec3>| expected.map(|expected| (found - expected).abs().element_sum() / 3.0);
            let (Some(straight), Some(other)) = (mean(shown(place, normal)), mean(shown(place, -normal))) else {
                return Err("the ball is where the volume holds nothing".to_owned());
            };
            n_pixels += 1;
            difference += straight;
            turned += other;
        }
    }
    let (difference, turned) = (difference / n_pixels as f32, turned / n_pixels as f32);
    println!(
        "ball: {n_pixels} pixels, mean difference {difference:.2} of 255; {turned:.2} for light from the other side"
    );
    let is_right = n_pixels > 1000 && difference <= ALLOWED && turned > 2.0 * difference;
    if is_right { Ok(()) } else { Err(format!("more than {ALLOWED}, or no less than half from the other side")) }
}

/// Where a ray meets the ball first.
fn on_ball(ray: Ray3d) -> Option<Vec3> {
    let to_eye = ray.origin - CENTER;
    let half = to_eye.dot(*ray.direction);
    let discriminant = half * half - (to_eye.length_squared() - RADIUS_M * RADIUS_M);
    (discriminant >= 0.0).then(|| ray.get_point(-half - discriminant.sqrt()))
}
