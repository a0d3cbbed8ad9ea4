//! The viewer without its window: state, panel and mouse as one egui program.

use crate::blit::PixelRect;
use crate::frame::check_view;
use crate::open_bake::OpenBake;
use crate::panel::{self, Figures};
use crate::stage::Stage;
use crate::state::ViewState;
use crate::viewport::Viewport;
use crate::views::ViewKind;
use localprt_scenes::Lighting;

/// Windows narrower than so many points have no room for a panel beside the picture.
const NARROW: f32 = 480.0;

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

impl<'a> App<'a> {
    /// An open bake as the command line wants it.
    pub fn new(bake: &'a OpenBake<'a>, state: ViewState, camera: usize, first_lighting: Lighting) -> Self {
        Self {
            bake,
            state,
            first_lighting,
            viewport: Viewport::new(bake),
            shows_panel: true,
            shows_keys: false,
            seconds: 0.0,
            render_scale: 1.0,
            requests: Requests::default(),
            notice: None,
            ev: 0.0,
            camera,
        }
    }

    /// Panel, picture and what the user does with them; the part of the window that the picture takes.
    pub fn ui(&mut self, ui: &mut egui::Ui, figures: &Figures<'_>) -> PixelRect {
        if self.shows_panel && ui.available_width() >= NARROW {
            egui::Panel::right("panel").default_size(330.0).size_range(240.0..=600.0).show(ui, |ui| {
                panel::panel(ui, self, figures);
            });
        }
        let pixels_per_point = ui.ctx().pixels_per_point();
        let frame = egui::Frame::NONE;
        let picture = egui::CentralPanel::no_frame().frame(frame).show(ui, |ui| {
            let rect = ui.available_rect_before_wrap();
            let response = ui.allocate_rect(rect, egui::Sense::click_and_drag());
            let mut viewport = std::mem::take(&mut self.viewport);
            viewport.interact(ui, &response, self);
            viewport.paint(ui, rect, self, figures);
            self.viewport = viewport;
            rect
        });
        if self.shows_keys {
            panel::keys_window(ui.ctx(), &mut self.shows_keys);
        }
        pixel_rect(picture.inner, pixels_per_point)
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

fn pixel_rect(rect: egui::Rect, pixels_per_point: f32) -> PixelRect {
    let pixel = |points: f32| (points * pixels_per_point).round().max(0.0) as u32;
    let (x, y) = (pixel(rect.min.x), pixel(rect.min.y));
    PixelRect { x, y, width: pixel(rect.max.x).saturating_sub(x), height: pixel(rect.max.y).saturating_sub(y) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_rects_fill_the_window_at_any_scale() {
        for (pixels, scale) in [(1280, 1.0), (1281, 1.5), (777, 1.25), (1000, 2.0)] {
            let points = pixels as f32 / scale;
            let rect = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(points, points));
            assert_eq!(pixel_rect(rect, scale).width, pixels);
        }
        let nothing = egui::Rect::from_min_max(egui::pos2(5.0, 5.0), egui::pos2(1.0, 5.0));
        assert_eq!(pixel_rect(nothing, 1.0).width, 0);
    }
}
