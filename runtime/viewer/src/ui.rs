//! The viewer's panel and picture as one egui program.

use crate::app::App;
use crate::blit::PixelRect;
use crate::panel::{self, Figures};
use crate::viewport;

/// Windows narrower than so many points have no room for a panel beside the picture.
const NARROW: f32 = 480.0;

impl App<'_> {
    /// Panel, picture and what the user does with them; the part of the window that the picture takes.
    pub fn ui(&mut self, ui: &mut egui::Ui, figures: &Figures<'_>) -> PixelRect {
        if self.shows_panel && ui.available_width() >= NARROW {
            egui::Panel::right("panel").default_size(330.0).size_range(240.0..=600.0).show(ui, |ui| {
                panel::panel(ui, self, figures);
            });
        }
        let pixels_per_point = ui.ctx().pixels_per_point();
        let picture = egui::CentralPanel::no_frame().show(ui, |ui| {
            let rect = ui.available_rect_before_wrap();
            let response = ui.allocate_rect(rect, egui::Sense::click_and_drag());
            viewport::interact(ui, &response, self);
            viewport::paint(ui, rect, self);
            if let Some(legend) = figures.legend {
                panel::legend::paint(&ui.painter_at(rect), rect, legend);
            }
            rect
        });
        if self.shows_keys {
            panel::keys_window(ui.ctx(), &mut self.shows_keys);
        }
        pixel_rect(picture.inner, pixels_per_point)
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
