//! Other systems beside the file: the shader says what the system itself says, and the file's part of a picture stays as it is.

mod small_bake;

use glam::Vec3;
use localprt_scenes::{Lighting, SurfacePoint};
use localprt_systems::{Feedback, Frame, KINDS, Query, Setup, Shaded, World};
use localprt_viewer::{
    Ball, Beside, Bounces, Engine, Files, GRAY_ALBEDO, Gpu, LitObject, Moment, OpenBake, OtherLight, OtherRecord,
    Renderer, Stage, ViewKind, ViewState, system_names,
};
use small_bake::{SmallBake, headless};
use std::f32::consts::PI;
use std::sync::Arc;

const SIZE: (u32, u32) = (96, 72);
const UPDATES: u64 = 4;
/// Hangs in the middle of the box, high above its blocks.
const BALL: LitObject = LitObject {
    center: Vec3::new(0.0, 1.5, 0.5),
    radius_m: 0.25,
    albedo: Vec3::splat(0.8),
    emission: Vec3::ZERO,
    circles: false,
};

/// A state with a system beside the file, and its stage.
fn state_of(bake: &OpenBake<'_>, system: &'static str) -> (ViewState, Stage) {
    let mut state = ViewState::new(bake, 0, &Lighting::of_scene(bake.scene()));
    state.bounces = Bounces::All;
    state.look.view = ViewKind::Indirect;
    state.beside = Some(Beside { system, split: 0.0 });
    state.object = Some(BALL);
    let stage = Stage::new(&state, bake.bounds, 0.0);
    (state, stage)
}

#[test]
fn the_shader_says_what_the_probes_of_a_system_say() {
    let Some(baked) = SmallBake::new("the_shader_says_what_the_probes_of_a_system_say") else { return };
    let files = Files::open(&baked.folder().join(baked.file()), None).expect("opens");
    let bake = OpenBake::new(&files).expect("a bake");
    let gpu = Gpu::headless().expect("a device");
    let aspect = SIZE.0 as f32 / SIZE.1 as f32;
    for name in ["ddgi", "ddgi-scaled", "light-field-irradiance", "ssgi-probes"] {
        let (state, stage) = state_of(&bake, name);
        // The ball is drawn; rays do not meet it, here and there.
        let moment = Moment { objects: Vec::new(), ..Moment::of(&state, &stage, aspect) };
        let mut engine = Engine::new(name, &bake.caster, &bake.baked).expect("a system");
        // The same system by itself.
        let kind = KINDS.iter().find(|kind| kind.name == name).expect("a kind");
        let world = World::new(&bake.caster, &moment.lighting);
        let setup =
            Setup { probes: bake.baked.view().probes.len(), cameras: std::slice::from_ref(&moment.camera), seed: 1 };
        let mut system = (kind.prepare)(&world, &setup);
        let mut light = None;
        for number in 0..UPDATES {
            light = Some(engine.update(&moment).light);
            let feedback = Feedback::Own;
            let camera = Some(&moment.camera);
            system.update(&Frame { world: &world, number, camera, feedback, events: &[], still: false });
        }
        let light = light.expect("some updates");
        assert!(matches!(light, OtherLight::Probes { .. }), "{name}");

        let mut renderer = Renderer::new(&gpu, &bake, &stage.lights, SIZE).expect("a renderer");
        renderer.set_other(&gpu, &Arc::new(light));
        renderer.render(&gpu, &bake, &state, &stage, &[]).expect("a picture");
        let picture = renderer.target().read_radiance(&gpu.device, &gpu.queue).expect("read back");

        // Pixels whose four corners lie on one surface: samples lie within. At its outline the ball of facets shows what is behind it.
        let (mut walls, mut ball) = (Vec::new(), Vec::new());
        for (pixel, &shown) in picture.iter().enumerate() {
            let at = |dx: f32, dy: f32| {
                let x = ((pixel as u32 % SIZE.0) as f32 + dx) / SIZE.0 as f32;
                let y = ((pixel as u32 / SIZE.0) as f32 + dy) / SIZE.1 as f32;
                let (origin, dir) = state.viewpoint.ray(x, y, aspect);
                if let Some(point) = on_ball(origin, dir) {
                    return Some((point, -dir, true));
                }
                let hit = bake.caster.closest_hit(origin, dir)?;
                Some((hit.surface_point(bake.scene()), -dir, false))
            };
            let Some((point, to_eye, is_ball)) = at(0.5, 0.5) else { continue };
            let is_same = |corner: (f32, f32)| {
                let other = at(corner.0, corner.1);
                other.is_some_and(|(other, to_eye, on)| {
                    on == is_ball && if on { other.normal.dot(to_eye) > 0.5 } else { other.normal == point.normal }
                })
            };
            if [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].into_iter().all(is_same) {
                let found = (Shaded { point, to_eye }, shown);
                if is_ball { ball.push(found) } else { walls.push(found) }
            }
        }
        assert!(walls.len() > picture.len() / 3 && ball.len() > 50, "{name}: {} {}", walls.len(), ball.len());
        // Of walls, f16 keeps 2^-11 of up to twice the mean, and moments near a wall lose digits to their variance. Facets of 7.5 degrees lie
        // up to 1 - cos 3.75 degrees = 0.2 % of the radius within: where a ray meets them at a cosine of 0.5 the normal is off by
        // 0.002 tan 60 = 0.004, and light of up to three times the ball's mean changes by about one and a half of itself per radian: 2 %.
        for (what, pixels, bounds) in [("walls", walls, [1e-3, 1e-2]), ("ball", ball, [4e-3, 2e-2])] {
            let points: Vec<Shaded> = pixels.iter().map(|(shaded, _)| *shaded).collect();
            let expected = system.irradiance(&world, &Query::of(&points));
            let scale = GRAY_ALBEDO / PI;
            let mean = expected.iter().map(|light| light.element_sum()).sum::<f32>() / (3 * expected.len()) as f32;
            let error = |((_, shown), expected): (&(Shaded, Vec3), &Vec3)| {
                (*shown / scale - *expected).abs().max_element() / mean
            };
            let mut errors: Vec<f32> = pixels.iter().zip(&expected).map(error).collect();
            errors.sort_by(f32::total_cmp);
            let [median, p99] = [0.5, 0.99].map(|share| errors[(share * errors.len() as f32) as usize]);
            eprintln!("{name}, {what}: median {median}, p99 {p99}, of {}", errors.len());
            assert!(mean > 0.1 && median < bounds[0] && p99 < bounds[1], "{name}, {what}: {mean} {median} {p99}");
        }
    }
}

/// The nearer point of the ball along a ray; nothing stands before it.
fn on_ball(origin: Vec3, dir: Vec3) -> Option<SurfacePoint> {
    let to_center = BALL.center - origin;
    let along = to_center.dot(dir);
    let room = BALL.radius_m.powi(2) - to_center.length_squared() + along * along;
    let position = origin + dir * (along - (room >= 0.0).then(|| room.sqrt())?);
    let normal = (position - BALL.center) / BALL.radius_m;
    Some(SurfacePoint { position, normal, geometric_normal: normal })
}

#[test]
fn systems_without_such_probes_show_their_light_at_the_receivers() {
    let Some(baked) = SmallBake::new("systems_without_such_probes_show_their_light_at_the_receivers") else { return };
    let files = Files::open(&baked.folder().join(baked.file()), None).expect("opens");
    let bake = OpenBake::new(&files).expect("a bake");
    for name in system_names() {
        let (state, stage) = state_of(&bake, name);
        let moment = Moment::of(&state, &stage, 1.5);
        let found = Engine::new(name, &bake.caster, &bake.baked).expect("a system").update(&moment);
        assert!(
            found.figures.probes >= 8 && found.figures.updates == 1 && found.figures.rays > 0,
            "{:?}",
            found.figures
        );
        let OtherLight::Map { size, rgba } = found.light else { continue };
        let view = bake.baked.view();
        assert_eq!((size, rgba.len()), (view.metadata.lightmap_size, (size * size) as usize));
        let texel = |texel: u32| rgba[texel as usize].map(half::f16::to_f32);
        let lit = view.receiver_texel.iter().filter(|&&own| texel(own)[..3].iter().any(|&band| band > 0.0)).count();
        assert!(lit * 2 > view.receiver_texel.len(), "{name}: {lit} of {}", view.receiver_texel.len());
        assert!(view.receiver_texel.iter().all(|&own| texel(own)[3] == 1.0));
        for &[own, receiver] in view.gutters {
            assert_eq!(texel(own), texel(view.receiver_texel[receiver as usize]), "{name}");
        }
    }
    // One gather alone is less than all of them.
    let (mut state, stage) = state_of(&bake, "ddgi");
    let mut mean_of = |bounces: Bounces| {
        state.bounces = bounces;
        let moment = Moment::of(&state, &stage, 1.5);
        let mut engine = Engine::new("ddgi", &bake.caster, &bake.baked).expect("a system");
        let lights: Vec<OtherLight> = (0..20).map(|_| engine.update(&moment).light).collect();
        let Some(OtherLight::Probes { record, texels }) = lights.last() else { panic!("DDGI has probes") };
        // Maps of irradiance lie behind the positions.
        let (n_probes, side) = (record.size.iter().product::<u32>() as usize, record.irradiance_side as usize + 2);
        texels[n_probes..][..n_probes * side * side].iter().map(|texel| texel[1]).sum::<f32>()
    };
    let (first, all) = (mean_of(Bounces::Exactly(1)), mean_of(Bounces::All));
    assert!(first > 0.0 && all > 1.05 * first, "{first} {all}");
    assert!(Engine::new("nonsense", &bake.caster, &bake.baked).is_none());
}

#[test]
fn systems_that_trace_see_what_moves() {
    let Some(baked) = SmallBake::new("systems_that_trace_see_what_moves") else { return };
    let files = Files::open(&baked.folder().join(baked.file()), None).expect("opens");
    let bake = OpenBake::new(&files).expect("a bake");
    let view = bake.baked.view();
    for name in ["hybrid", "ddgi", "ddgi-scaled", "ssgi-probes"] {
        let (mut state, stage) = state_of(&bake, name);
        state.object = None;
        let mut engine = Engine::new(name, &bake.caster, &bake.baked).expect("a system");
        let mut mean = |state: &ViewState| {
            let moment = Moment::of(state, &Stage::new(state, bake.bounds, 0.0), 1.5);
            let lights: Vec<OtherLight> = (0..120).map(|_| engine.update(&moment).light).collect();
            match lights.last() {
                Some(OtherLight::Map { rgba, .. }) => {
                    let light = |&texel: &u32| rgba[texel as usize][1].to_f32();
                    view.receiver_texel.iter().map(light).sum::<f32>() / view.receiver_texel.len() as f32
                }
                Some(OtherLight::Probes { record, texels }) if record.kind == OtherRecord::HARMONICS => {
                    // The first of nine coefficients, behind low and spacing of each grid.
                    let first = |probe: &[[f32; 4]]| probe[0][1];
                    texels[2 * record.n_grids as usize..].chunks_exact(9).map(first).sum()
                }
                Some(OtherLight::Probes { record, texels }) => {
                    let n_probes = record.size.iter().product::<u32>() as usize;
                    let side = record.irradiance_side as usize + 2;
                    // As the shader makes light of what maps hold.
                    let power = record.stored_power * record.mean_power;
                    texels[n_probes..][..n_probes * side * side].iter().map(|texel| texel[1].powf(power)).sum::<f32>()
                }
                None => panic!("some updates"),
            }
        };
        let open = mean(&state);
        // An all but black ball around the lamp.
        state.balls = vec![Ball { center: stage.lights[0].position, radius_m: 0.2, circles: false }];
        let closed = mean(&state);
        state.balls.clear();
        let again = mean(&state);
        eprintln!("{name}: {open}, with the ball {closed}, without again {again}");
        assert!(closed < 0.3 * open, "{name}: {open} {closed}");
        assert!((again / open - 1.0).abs() < 0.1, "{name}: {open} {again}");
    }
}

#[test]
fn a_split_picture_is_the_files_on_the_left_and_the_others_on_the_right() {
    let Some(baked) = SmallBake::new("a_split_picture_is_the_files_on_the_left_and_the_others_on_the_right") else {
        return;
    };
    let (width, height) = (96, 72);
    let look = ["--size", "96x72", "--view", "lighting", "--exposure", "0", "--frames", "4"];
    let picture = |name: &str, more: &[&str]| headless(&baked, name, &[&look[..], more].concat());
    let own = picture("own.png", &[]);
    for system in ["ddgi", "light-field-traced"] {
        let other = picture("other.png", &["--system", system, "--split", "0"]);
        let split = picture("split.png", &["--system", system, "--split", "0.25"]);
        for y in 0..height {
            let part =
                |pixels: &[u8], from: usize, to: usize| pixels[3 * (y * width + from)..3 * (y * width + to)].to_vec();
            assert_eq!(part(&split, 0, 23), part(&own, 0, 23), "{system}, row {y}");
            assert_eq!(part(&split, 23, 25), [255; 6], "a line");
            assert_eq!(part(&split, 25, width), part(&other, 25, width), "{system}, row {y}");
        }
        assert_ne!(own, other);
    }
    // Maps of the file show nothing of other systems.
    let look = ["--size", "96x72", "--view", "clusters"];
    let map = headless(&baked, "map.png", &look);
    assert_eq!(map, headless(&baked, "split.png", &[&look[..], &["--system", "ddgi", "--frames", "1"]].concat()));
}
