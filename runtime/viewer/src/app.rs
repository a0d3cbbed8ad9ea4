//! The viewer without its window: an open bake and all that a user changes of it.

use crate::frame::check_view;
use crate::gizmo::Drag;
use crate::open_bake::OpenBake;
use crate::other_light::OtherLight;
use crate::other_system::OtherFigures;
use crate::stage::Stage;
use crate::state::ViewState;
use crate::views::ViewKind;
use glam::Vec3;
use localprt_scenes::Lighting;
use std::sync::Arc;

/// One open bake under a user's hands.
pub struct App<'a> {
    /// What is shown.
    pub bake: &'a OpenBake<'a>,
    /// What the user changes.
    pub state: ViewState,
    /// The lighting that the viewer was started with.
    pub first_lighting: Lighting,
    /// Mouse and keys over the picture.
    pub viewport: Viewport,
    /// Whether the panel is there.
    pub shows_panel: bool,
    /// Whether the list of keys is there.
    pub shows_keys: bool,
    /// Seconds of moving so far.
    pub seconds: f32,
    /// Pixels of the picture per pixel of the window, 0..=1.
    pub render_scale: f32,
    /// Asked for by keys or panel, done by the window.
    pub requests: Requests,
    /// What was done last, for the line at the bottom.
    pub notice: Option<String>,
    /// Exposure value of the last picture.
    pub ev: f32,
    /// What the system beside the file has found last.
    pub other: Option<(Arc<OtherLight>, OtherFigures)>,
    camera: usize,
}

/// What stays as the user has it when the file is loaded again.
pub struct Kept {
    state: ViewState,
    first_lighting: Lighting,
    viewport: Viewport,
    shows_panel: bool,
    shows_keys: bool,
    seconds: f32,
    render_scale: f32,
    camera: usize,
}

/// What only the window can do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requests {
    /// Forget all light.
    pub reset: bool,
    /// Measure the exposure again.
    pub meter: bool,
    /// Write the picture.
    pub save_picture: bool,
    /// Write the lighting.
    pub save_lighting: bool,
    /// Close.
    pub quit: bool,
}

/// How the mouse moves the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CameraMode {
    /// Dragging turns the head.
    #[default]
    Fly,
    /// Dragging leads around what is in the middle.
    Orbit,
}

/// The light that is being dragged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Held {
    pub light: usize,
    pub drag: Drag,
    /// Place of the handle when it was taken.
    pub start: Vec3,
    /// Ray under the mouse then.
    pub start_ray: (Vec3, Vec3),
}

/// State of mouse and keys.
#[derive(Clone, Debug, Default)]
pub struct Viewport {
    /// How the mouse moves the camera.
    pub mode: CameraMode,
    /// Metres per second.
    pub speed: f32,
    pub(crate) held: Option<Held>,
}

impl<'a> App<'a> {
    /// An open bake as the command line wants it.
    pub fn new(bake: &'a OpenBake<'a>, state: ViewState, camera: usize, first_lighting: Lighting) -> Self {
        Self {
            bake,
            state,
            first_lighting,
            viewport: Viewport { mode: CameraMode::Fly, speed: 0.2 * bake.extent_m(), held: None },
            shows_panel: true,
            shows_keys: false,
            seconds: 0.0,
            render_scale: 1.0,
            requests: Requests::default(),
            notice: None,
            ev: 0.0,
            other: None,
            camera,
        }
    }

    /// Leaves the bake.
    pub fn keep(self) -> Kept {
        let Self { bake: _, state, first_lighting, viewport, shows_panel, shows_keys, seconds, render_scale, .. } =
            self;
        let camera = self.camera;
        Kept { state, first_lighting, viewport, shows_panel, shows_keys, seconds, render_scale, camera }
    }

    /// Another bake as it was left: with the same camera, light and look. What names a part of the bake is dropped: receivers and
    /// probes have other numbers there.
    pub fn resume(bake: &'a OpenBake<'a>, kept: Kept) -> Self {
        let Kept { mut state, first_lighting, viewport, shows_panel, shows_keys, seconds, render_scale, camera } = kept;
        (state.overlays.probe, state.overlays.receiver) = (None, None);
        let is_there = |name: &String| bake.scene().materials.iter().any(|material| material.name == *name);
        state.materials.retain(|name, _| is_there(name));
        if check_view(bake, state.look.view).is_err() {
            state.look.view = ViewKind::Final;
        }
        let viewport = Viewport { held: None, ..viewport };
        let camera = camera.min(bake.cameras.len() - 1);
        let app = Self::new(bake, state, camera, first_lighting);
        Self { viewport, shows_panel, shows_keys, seconds, render_scale, ..app }
    }

    /// Shows a view, or says why it cannot.
    pub fn show(&mut self, view: ViewKind) {
        match check_view(self.bake, view) {
            Ok(()) => {
                self.state.look.view = view;
                self.notice = None;
            }
            Err(error) => self.notice = Some(error.to_string()),
        }
    }

    /// Goes to the scene's next camera.
    pub fn next_camera(&mut self) {
        self.go_to_camera((self.camera + 1) % self.bake.cameras.len());
    }

    /// Goes to a camera of the scene.
    pub fn go_to_camera(&mut self, camera: usize) {
        self.camera = camera;
        self.state.go_to(self.bake, self.camera);
        self.notice = Some(format!("camera {}: {}", self.camera, self.bake.cameras[self.camera].name));
    }

    /// Lights, sky and materials as at the start; nothing that moves.
    pub fn restore(&mut self) {
        self.state.set_lighting(&self.first_lighting);
        (self.state.balls, self.state.door, self.state.object) = (Vec::new(), None, None);
        self.requests.reset = true;
    }

    /// Lights and things where they are now.
    pub fn stage(&self) -> Stage {
        Stage::new(&self.state, self.bake.bounds, self.seconds)
    }

    /// Time goes by.
    pub fn advance(&mut self, seconds: f32) {
        if self.state.animate {
            // A frame that took long must not make things jump far.
            self.seconds += seconds.min(0.25);
        }
    }
}
