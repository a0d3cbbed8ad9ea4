//! From a command line to a window, or to pictures.

use crate::app::App;
use crate::cli::{Cli, OverlayName, Thing};
use crate::daylight::{daylight, is_dark};
use crate::frame::check_view;
use crate::headless::{Headless, picture_size};
use crate::open_bake::{Files, OpenBake, SceneSource};
use crate::other_light::Beside;
use crate::state::{Ball, Bounces, Door, LitObject, SceneLight, ViewState, new_light, torch};
use crate::window::{Reloaded, Session, WindowOptions};
use localprt_runtime::MAX_OCCLUDERS;
use localprt_scenes::LightKind;
use localprt_tools::error::{CommandError, Exit};
use localprt_tools::inputs;
use web_time::Instant;

/// Does what a command line says.
///
/// # Errors
/// What the user has to know, with its exit code.
pub fn run(cli: &Cli) -> Result<(), CommandError> {
    let started = Instant::now();
    let files = Files::open(&cli.file, cli.scene.as_deref())?.in_variant(cli.variant.as_deref())?;
    let bake = OpenBake::new(&files)?;
    let mut lighting = inputs::lighting(cli.lights.as_deref(), &files.scene)?;
    let has_light = |thing: &Thing| matches!(thing, Thing::Torch | Thing::Lamp);
    let dark = is_dark(&files.scene, &lighting) && !cli.things.iter().any(has_light);
    // Who gives a lighting file means it.
    let needs_daylight = dark && cli.lights.is_none() && !cli.headless;
    if needs_daylight {
        lighting = daylight();
    }
    if cli.camera.is_some() {
        inputs::camera(&bake.caster, cli.camera)?;
    }
    check_view(&bake, cli.view)?;
    let camera = cli.camera.unwrap_or(0);
    let size = cli.size.unwrap_or_else(|| picture_size(&bake, camera));
    let mut state = ViewState::new(&bake, camera, &lighting);
    set_look(&mut state, cli);
    bring(&mut state, cli, &bake)?;
    set_overlays(&mut state, cli, &bake, size.0 as f32 / size.1 as f32)?;
    if cli.headless {
        if dark {
            eprintln!("nothing shines: neither the scene nor its lighting has a light; give one with --lights");
        }
        return Headless { bake: &bake, state, size }.run(cli, started);
    }
    let options = WindowOptions {
        size: cli.size.unwrap_or((1280, 720)),
        screenshot: cli.screenshot.clone(),
        screenshot_frames: cli.frames.map_or(8, u64::from),
        lose_device: cli.lose_device,
        started,
    };
    let mut session = Session::new(options)?;
    let mut app = App::new(&bake, state, camera, lighting);
    if needs_daylight {
        app.notice = Some("nothing shone here, so there are a sun and a sky now".into());
    }
    app.shows_panel = !cli.no_panel;
    let source = SceneSource { path: cli.scene.clone(), variant: cli.variant.clone() };
    let mut next = session.show(app, &source)?;
    drop(bake);
    drop(files);
    while let Some(Reloaded { files, kept }) = next {
        let bake = OpenBake::new(&files)?;
        let mut app = App::resume(&bake, kept);
        app.notice = Some(format!("{} has changed and was loaded again", files.path.display()));
        next = session.show(app, &source)?;
    }
    Ok(())
}

fn set_look(state: &mut ViewState, cli: &Cli) {
    state.look.view = cli.view;
    state.look.exposure = cli.exposure;
    state.look.tone_map = cli.tone_map;
    state.look.normal_maps = !cli.no_normal_maps;
    state.look.cull_backs = cli.cull_backs;
    if cli.specular {
        state.look.toggle_specular();
    }
    state.bounces = cli.bounces.map_or(Bounces::All, Bounces::Exactly);
    state.animate = cli.animate;
    state.beside = cli.system.map(|system| Beside { system, split: cli.split });
}

fn bring(state: &mut ViewState, cli: &Cli, bake: &OpenBake<'_>) -> Result<(), CommandError> {
    let viewpoint = state.viewpoint;
    for thing in &cli.things {
        match thing {
            Thing::Ball => state.balls.push(Ball::new(bake, &viewpoint)),
            Thing::Door => state.door = Some(Door::new(bake, &viewpoint)),
            Thing::LitBall => state.object = Some(LitObject::new(bake, &viewpoint)),
            Thing::Torch => state.lights.push(torch(&viewpoint, bake.extent_m())),
            Thing::Lamp => {
                let light = new_light(LightKind::Point, &viewpoint, bake.extent_m());
                state.lights.push(SceneLight { circles: true, ..SceneLight::new(light) });
            }
        }
    }
    let n_occluders = state.balls.len() + usize::from(state.door.is_some());
    if n_occluders > MAX_OCCLUDERS {
        let what = format!("{n_occluders} things that block light are too many");
        return Err(CommandError::new(Exit::Usage, what).help(format!("bring at most {MAX_OCCLUDERS}")));
    }
    Ok(())
}

fn set_overlays(state: &mut ViewState, cli: &Cli, bake: &OpenBake<'_>, aspect: f32) -> Result<(), CommandError> {
    let shows = |name: OverlayName| cli.overlay.contains(&name);
    let n_probes = bake.baked.view().probes.len();
    if let Some(probe) = cli.probe.filter(|&probe| probe as usize >= n_probes) {
        let help = format!("give a number below {n_probes}");
        return Err(CommandError::new(Exit::Usage, format!("the file has no probe {probe}")).help(help));
    }
    state.overlays.probes = shows(OverlayName::Probes);
    state.overlays.lights = shows(OverlayName::Lights);
    state.overlays.rays = shows(OverlayName::Rays);
    let wants_probe = shows(OverlayName::Support) || shows(OverlayName::Rays);
    state.overlays.probe = cli.probe.or_else(|| (wants_probe && n_probes > 0).then_some(0));
    if let Some((x, y)) = cli.pick.or_else(|| shows(OverlayName::Receiver).then_some((0.5, 0.5))) {
        let (origin, dir) = state.viewpoint.ray(x, y, aspect);
        let hit = bake.caster.closest_hit(origin, dir);
        state.overlays.receiver = hit.and_then(|hit| bake.nearest_receiver(hit.position, hit.normal));
        if state.overlays.receiver.is_none() {
            let what = format!("there is no receiver at {x},{y} of the picture");
            return Err(CommandError::new(Exit::Usage, what).help("give another place with --pick X,Y"));
        }
    }
    Ok(())
}
