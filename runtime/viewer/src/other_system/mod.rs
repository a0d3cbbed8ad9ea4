//! Other systems of the field beside the file, on the same scene and light: the feature `systems`.
//!
//! In: the file's scene and receivers, and a [`Moment`]. Out: a [`Found`], frame by frame. A system finds its light on the CPU, and
//! hands its probes to the shader. Those that trace rays for every point are asked for the light of the receivers instead: as many rays per
//! pixel, up to 256, would be a second of a frame on common devices, and receivers keep the average over frames that belongs to it.
//!
//! Rays meet what moves, too: the tree of rays is made anew for every update while there are objects. Objects have their light where
//! their probes are in the shader, and the file's elsewhere. Light field probes alone know only the geometry that they were made with.

#[cfg(all(feature = "systems", not(target_arch = "wasm32")))]
mod present;
#[cfg(not(all(feature = "systems", not(target_arch = "wasm32"))))]
#[path = "absent.rs"]
mod present;

pub(crate) use present::Beneath;
pub use present::{Engine, names};

use crate::objects::MovingObject;
#[cfg(not(target_arch = "wasm32"))]
use crate::open_bake::OpenBake;
use crate::other_light::OtherLight;
use crate::stage::Stage;
use crate::state::{Bounces, ViewState};
use localprt_scenes::{Camera, Lighting};

/// Updates under light that stays, after which a system rests: of DDGI, which keeps 97 % of a frame and waits with each bounce for the one
/// before it, some 300 bring all bounces in.
#[cfg(not(target_arch = "wasm32"))]
pub const UPDATES: u32 = 320;

/// What a frame of another system starts from.
#[derive(Clone, Debug)]
pub struct Moment {
    /// What shines, and materials.
    pub lighting: Lighting,
    /// What moves.
    pub objects: Vec<MovingObject>,
    /// From where the picture is taken.
    pub camera: Camera,
    /// One gather alone; otherwise the system feeds itself, frame by frame.
    pub is_first_bounce: bool,
}

impl Moment {
    /// Of a state, for a picture of this width over height.
    pub fn of(state: &ViewState, stage: &Stage, aspect: f32) -> Self {
        let viewpoint = &state.viewpoint;
        Self {
            lighting: state.lighting(stage.lights.clone()),
            objects: stage.objects.clone(),
            camera: Camera {
                name: String::new(),
                to_world: viewpoint.to_world,
                fov_y: viewpoint.fov_y,
                aspect: Some(aspect),
            },
            is_first_bounce: state.bounces == Bounces::Exactly(1),
        }
    }
}

/// A frame of another system.
#[derive(Clone, Debug)]
pub struct Found {
    /// Its light.
    pub light: OtherLight,
    /// What it took.
    pub figures: OtherFigures,
}

/// What has come of the system beneath a window since it was asked last.
#[cfg_attr(
    not(all(feature = "systems", not(target_arch = "wasm32"))),
    expect(dead_code, reason = "without systems there is no news")
)]
pub(crate) enum News {
    /// Nothing.
    Nothing,
    /// What was found before is no light of the system that is wanted now.
    Gone,
    /// A frame.
    Found(Found),
}

/// What another system has and takes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OtherFigures {
    /// What it is called.
    pub title: &'static str,
    /// Probes that it has.
    pub probes: usize,
    /// Bytes that it keeps, in the formats of its paper.
    pub bytes: u64,
    /// Rays of the last update, those to lights among them.
    pub rays: u64,
    /// Updates so far.
    pub updates: u64,
    /// Of the last update and of what was asked of it, on the CPU.
    pub seconds: f64,
}

impl OtherFigures {
    /// In a line.
    pub fn summary(&self) -> String {
        let Self { title, probes, bytes, rays, updates, seconds } = self;
        let megabytes = *bytes as f64 / 1e6;
        let milliseconds = 1e3 * seconds;
        format!("{title}: {probes} probes, {megabytes:.2} MB; update {updates}: {rays} rays, {milliseconds:.0} ms")
    }
}

/// The engine of the system that a state has beside the file; `None` without.
#[cfg(not(target_arch = "wasm32"))]
pub fn engine<'a>(bake: &'a OpenBake<'_>, state: &ViewState) -> Option<Engine<'a>> {
    let beside = state.beside?;
    Engine::new(beside.system, &bake.caster, &bake.baked)
}
