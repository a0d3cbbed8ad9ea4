//! A light on its way through a baked scene, frame by frame: pictures of each and all of them on one sheet.
//!
//! `cargo run --release -p localprt-viewer --example turntable -- FILE.lprt -o DIR`

use clap::Parser;
use glam::{Mat4, Vec3};
use localprt_formats::{Baked, weight};
use localprt_precompute::lightmap::Atlas;
use localprt_precompute::output::write_png;
use localprt_precompute::picture::{Exposure, default_camera};
use localprt_precompute::rays::RayCaster;
use localprt_precompute::relight::{material_overrides, scene_texels, sky_inputs};
use localprt_runtime::host_shading::RadianceDegree1;
use localprt_runtime::passes::volume_fill::volume_fill;
use localprt_runtime::{
    CheckedBake, DirectLight, DirectOptions, Occluder, OccluderShape, PassTime, Relighter, RelighterOptions,
    ShadowCasters, VolumeSampler, gpu::headless,
};
use localprt_scenes::{Light, LightKind, Lighting};
use localprt_viewer::{
    DrawOptions, MovingObject, ObjectShape, OffscreenTarget, SceneDraw, Specular, View, moving_casters,
};
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Parser)]
#[command(about = "Pictures of a baked scene under a moving light")]
struct Options {
    /// Baked file; its scene lies beside it.
    file: PathBuf,
    /// Folder for the pictures.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[arg(long, default_value_t = 24)]
    frames: u32,
    #[arg(long, default_value = "480x360", value_parser = size)]
    size: (u32, u32),
    /// Sky, materials and further lights.
    #[arg(long, value_name = "L.json")]
    lights: Option<PathBuf>,
    /// No moving light: those of --lights, or the scene's own.
    #[arg(long)]
    still: bool,
    /// Middle of the moving light's ellipse; else that of the scene's box at a third of its height.
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    center: Option<Vec3>,
    /// Half axes of the ellipse along x and z, as shares of the box.
    #[arg(long, default_value = "0.2,0.1", value_parser = pair)]
    radius: (f32, f32),
    /// Candela of the moving light; else so that a quarter of the longest side away there are 10 lux.
    #[arg(long)]
    intensity: Option<f32>,
    #[arg(long)]
    normal_maps: bool,
    #[arg(long)]
    specular: bool,
    /// Roughness of everything, with --specular.
    #[arg(long, default_value_t = 0.4)]
    roughness: f32,
    /// A black ball goes around against the light.
    #[arg(long)]
    occluder: bool,
    /// A white ball goes around with the light, lit by the probes around it.
    #[arg(long)]
    ball: bool,
    /// Radius of the balls, metres; else a tenth of the shortest side of the box.
    #[arg(long, value_name = "M")]
    ball_radius: Option<f32>,
    /// Material that shines in the second half.
    #[arg(long, value_name = "MATERIAL")]
    door: Option<String>,
    /// Radiance of that material.
    #[arg(long, default_value_t = 20.0)]
    door_radiance: f32,
    /// Exposure value; else that of the first frame's picture.
    #[arg(long, allow_hyphen_values = true)]
    exposure: Option<f32>,
    /// Camera of the scene by number; a default one if there is none.
    #[arg(long, default_value_t = 0)]
    camera: usize,
    /// Texels per side of shadow maps.
    #[arg(long, default_value_t = 1024)]
    shadow_map: u32,
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let numbers = text.split_once('x').map(|(width, height)| (width.parse(), height.parse()));
    match numbers {
        Some((Ok(width), Ok(height))) if width > 0 && height > 0 => Ok((width, height)),
        _ => Err("must look like 480x360".into()),
    }
}

fn numbers<const N: usize>(text: &str) -> Result<[f32; N], String> {
    let parsed: Result<Vec<f32>, _> = text.split(',').map(str::parse).collect();
    parsed.ok().and_then(|values| values.try_into().ok()).ok_or_else(|| format!("must be {N} numbers with commas"))
}

fn vector(text: &str) -> Result<Vec3, String> {
    numbers(text).map(Vec3::from_array)
}

fn pair(text: &str) -> Result<(f32, f32), String> {
    numbers(text).map(|[x, z]| (x, z))
}

/// Where things move.
struct Path {
    center: Vec3,
    radius: Vec3,
}

impl Path {
    fn at(&self, turn: f32, share: f32) -> Vec3 {
        let (sin, cos) = (turn * std::f32::consts::TAU).sin_cos();
        self.center + share * self.radius * Vec3::new(cos, 0.0, sin)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    std::fs::create_dir_all(&options.output)?;
    let baked = Baked::open(&options.file)?;
    let baked = baked.view();
    let checked = CheckedBake::new(baked)?;
    let scene_path = options.file.parent().unwrap_or("".as_ref()).join(&baked.metadata.scene_path);
    let scene = localprt_scenes::load(&scene_path)?;
    if scene.hash != baked.metadata.scene_hash {
        return Err(format!("{} is not the scene that was baked", scene_path.display()).into());
    }
    let mut lighting = match &options.lights {
        Some(path) => Lighting::load_for(path, &scene)?,
        None if options.still => Lighting::of_scene(&scene),
        None => Lighting::default(),
    };
    let camera = match scene.cameras.get(options.camera) {
        Some(camera) => camera.clone(),
        None => default_camera(&RayCaster::new(&scene)?).ok_or("the scene has no triangles")?,
    };
    let view = View::of_camera(&camera, scene.extent());
    let (low, high) = scene.bounds().ok_or("the scene has no triangles")?;
    let extent = high - low;
    let path = Path {
        center: options.center.unwrap_or(low + extent * Vec3::new(0.5, 1.0 / 3.0, 0.5)),
        radius: extent * Vec3::new(options.radius.0, 0.0, options.radius.1),
    };
    let ball_m = options.ball_radius.unwrap_or(0.1 * extent.min_element());
    let candela = options.intensity.unwrap_or(10.0 * (0.25 * extent.max_element()).powi(2));
    let base_lights = lighting.lights.clone();

    let started = Instant::now();
    let (device, queue) = pollster::block_on(headless())?;
    let n_lights = base_lights.len() as u32 + u32::from(!options.still);
    let direct = DirectOptions { shadow_map_size: options.shadow_map, shadow_layers: 6 * n_lights.clamp(1, 40) };
    let relighter_options = RelighterOptions { direct, ..RelighterOptions::default() };
    let mut gi = Relighter::new(&device, &queue, baked, relighter_options)?;
    gi.set_scene(&scene_texels(&scene, &Atlas::of(&scene), &baked), &ShadowCasters::of_scene(&scene))?;
    gi.set_sky(&sky_inputs(&lighting.sky, &baked).sh, &[])?;
    let draw_options = DrawOptions {
        normal_maps: options.normal_maps,
        specular: options.specular.then_some(Specular { f0: 0.04, roughness: Some(options.roughness) }),
        cull_backs: false,
    };
    let mut draw = SceneDraw::new(&device, &queue, &scene, &gi, draw_options)?;
    draw.set_sky(&device, &queue, &lighting.sky);
    let target = OffscreenTarget::new(&device, options.size.0, options.size.1);
    println!("prepared in {:.1} s", started.elapsed().as_secs_f64());

    let mut scale = options.exposure.map(f32::exp2);
    let mut pictures = Vec::new();
    let (mut times, mut relit_ms, mut drawn_ms) = (Vec::new(), Vec::new(), Vec::new());
    for frame in 0..options.frames {
        let turn = frame as f32 / options.frames as f32;
        lighting.lights.clone_from(&base_lights);
        if !options.still {
            lighting.lights.push(point_light(path.at(turn, 1.0), candela));
        }
        gi.set_lights(&lighting.lights);
        if let Some(name) = options.door.as_ref().filter(|_| 2 * frame >= options.frames) {
            let own = lighting.materials.entry(name.clone()).or_default();
            own.emission = Some(Vec3::splat(options.door_radiance));
            lighting.check_materials(&scene)?;
        }
        let overrides = material_overrides(&scene, &lighting);
        gi.set_materials(&overrides, lighting.albedo_override)?;
        draw.set_materials(&queue, &overrides, lighting.albedo_override);

        let mut objects = Vec::new();
        if options.occluder {
            let center = path.at(-2.0 * turn, 0.5);
            let shape = OccluderShape::Sphere { center, radius: ball_m };
            gi.set_occluders(&[Occluder { shape, radiance: Vec3::ZERO }])?;
            objects.push(ball(center, ball_m, 0.0, [Vec3::ZERO; 4]));
        }
        if options.ball {
            let center = path.at(turn + 0.15, 0.8);
            objects.push(ball(center, ball_m, 0.8, light_at(&gi, &checked, center)?));
        }
        if !objects.is_empty() {
            gi.set_moving_casters(&moving_casters(&objects))?;
            draw.set_objects(&device, &queue, &objects);
        }

        let started = Instant::now();
        let mut encoder = device.create_command_encoder(&Default::default());
        gi.encode(&mut encoder, &DirectLight::Lights)?;
        queue.submit([encoder.finish()]);
        let passes = gi.wait_for_pass_times();
        device.poll(wgpu::PollType::wait_indefinitely())?;
        let relit = started.elapsed().as_secs_f64() * 1e3;
        let mut encoder = device.create_command_encoder(&Default::default());
        draw.encode(&queue, &mut encoder, &gi, &view, &target)?;
        queue.submit([encoder.finish()]);
        device.poll(wgpu::PollType::wait_indefinitely())?;
        let drawn = started.elapsed().as_secs_f64() * 1e3 - relit;
        if scale.is_none() {
            let ev = Exposure::Auto.ev(&target.read_radiance(&device, &queue)?);
            println!("exposure {ev:.2} EV");
            scale = Some(ev.exp2());
        }
        let mut encoder = device.create_command_encoder(&Default::default());
        target.tone_map(&queue, &mut encoder, scale.unwrap_or(1.0));
        queue.submit([encoder.finish()]);
        let picture = target.read_srgb(&device, &queue)?;
        println!("frame {frame}: relight {relit:.1} ms, draw {drawn:.1} ms");
        write_png(&options.output.join(format!("frame_{frame:03}.png")), options.size.0, options.size.1, &picture)?;
        pictures.push(picture);
        relit_ms.push(relit);
        drawn_ms.push(drawn);
        add_times(&mut times, passes.unwrap_or_default());
    }
    let (sheet, width, height) = contact_sheet(&pictures, options.size, 6);
    write_png(&options.output.join("sheet.png"), width, height, &sheet)?;
    print_times(&times, &relit_ms, &drawn_ms);
    println!("device memory of the relighter");
    for (what, bytes) in gi.memory() {
        println!("  {what:<38} {:>9.2} MB", bytes as f64 * 1e-6);
    }
    println!("wrote {}", options.output.join("sheet.png").display());
    Ok(())
}

fn point_light(position: Vec3, candela: f32) -> Light {
    Light {
        name: "moving".into(),
        kind: LightKind::Point,
        position,
        direction: Vec3::NEG_Y,
        color: Vec3::new(1.0, 0.9, 0.75),
        intensity: candela,
        range: None,
    }
}

fn ball(center: Vec3, radius: f32, albedo: f32, light: RadianceDegree1) -> MovingObject {
    MovingObject {
        shape: ObjectShape::Sphere,
        to_world: Mat4::from_translation(center) * Mat4::from_scale(Vec3::splat(radius)),
        albedo: Vec3::splat(albedo),
        emission: Vec3::ZERO,
        light,
    }
}

/// Radiance of degree 1 at a point: from the file's volume, if it has one, else that of the probes around it by the weight
/// kernel, which knows no walls.
fn light_at(gi: &Relighter, baked: &CheckedBake<'_>, at: Vec3) -> Result<RadianceDegree1, Box<dyn Error>> {
    if let Some(volume) = baked.volume() {
        let mut cells = vec![Vec3::ZERO; volume.n_cells() * volume.n_k()];
        volume_fill(volume, &gi.read_volume()?, &mut cells);
        let radiance = VolumeSampler::new(volume, &cells).radiance_at(at).unwrap_or_default();
        return Ok([radiance[0], radiance[1], radiance[2], radiance[3]]);
    }
    let n_sh = baked.n_sh();
    let radiance = gi.read_probe_radiance()?;
    let mut sum = [Vec3::ZERO; 4];
    let mut weights = 0.0;
    for (probe, own) in baked.view().probes.iter().zip(radiance.chunks_exact(n_sh)) {
        let weight = weight::weight_kernel(Vec3::from(probe.position).distance(at) / probe.support_radius_m);
        sum.iter_mut().zip(own).for_each(|(sum, value)| *sum += weight * *value);
        weights += weight;
    }
    Ok(if weights > 0.0 { sum.map(|value| value / weights) } else { sum })
}

fn add_times(sums: &mut Vec<PassTime>, times: Vec<PassTime>) {
    for time in times {
        match sums.iter_mut().find(|sum| sum.name == time.name) {
            Some(sum) => sum.milliseconds += time.milliseconds,
            None => sums.push(time),
        }
    }
}

fn print_times(times: &[PassTime], relit_ms: &[f64], drawn_ms: &[f64]) {
    let n_frames = relit_ms.len().max(1) as f64;
    let mean = |milliseconds: &[f64]| milliseconds.iter().sum::<f64>() / n_frames;
    println!("mean of {} frames: relight {:.1} ms, draw {:.1} ms", relit_ms.len(), mean(relit_ms), mean(drawn_ms));
    for time in times {
        println!("  {:<24} {:>8.2} ms", time.name, time.milliseconds / n_frames);
    }
}

/// Pictures side by side at half size, as one picture with its size.
fn contact_sheet(pictures: &[Vec<u8>], (width, height): (u32, u32), columns: u32) -> (Vec<u8>, u32, u32) {
    let (tile_width, tile_height) = (width.div_ceil(2), height.div_ceil(2));
    let columns = columns.min(pictures.len() as u32).max(1);
    let rows = (pictures.len() as u32).div_ceil(columns);
    let (sheet_width, sheet_height) = (columns * tile_width, rows * tile_height);
    let mut sheet = vec![0; (sheet_width * sheet_height * 3) as usize];
    for (index, picture) in pictures.iter().enumerate() {
        let (left, top) = (index as u32 % columns * tile_width, index as u32 / columns * tile_height);
        for (y, x) in (0..tile_height).flat_map(|y| (0..tile_width).map(move |x| (y, x))) {
            for band in 0..3 {
                let byte = |dx: u32, dy: u32| {
                    let (x, y) = ((2 * x + dx).min(width - 1), (2 * y + dy).min(height - 1));
                    u32::from(picture[((y * width + x) * 3 + band) as usize])
                };
                let mean = (byte(0, 0) + byte(1, 0) + byte(0, 1) + byte(1, 1)) / 4;
                sheet[(((top + y) * sheet_width + left + x) * 3 + band) as usize] = mean as u8;
            }
        }
    }
    (sheet, sheet_width, sheet_height)
}
