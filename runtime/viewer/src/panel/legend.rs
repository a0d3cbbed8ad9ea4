//! What the colors of a map view mean, in a corner of the picture.

use crate::receiver_maps::Legend;

/// Draws a legend into the upper left corner.
pub fn paint(painter: &egui::Painter, rect: egui::Rect, legend: &Legend) {
    let font = egui::FontId::proportional(13.0);
    let text = |text: &str| painter.layout_no_wrap(text.into(), font.clone(), egui::Color32::from_gray(235));
    let has_ramp = !legend.colors.is_empty();
    let title = text(&legend.title);
    let note = text(&legend.note);
    let width = title.size().x.max(note.size().x).max(if has_ramp { 220.0 } else { 0.0 });
    let ramp_height = if has_ramp { 36.0 } else { 0.0 };
    let size = egui::vec2(width + 20.0, 46.0 + ramp_height);
    let frame = egui::Rect::from_min_size(rect.min + egui::vec2(8.0, 8.0), size);
    painter.rect_filled(frame, 4.0, egui::Color32::from_black_alpha(190));
    let left = frame.left() + 10.0;
    painter.galley(egui::pos2(left, frame.top() + 6.0), title, egui::Color32::WHITE);
    painter.galley(egui::pos2(left, frame.bottom() - 20.0), note, egui::Color32::WHITE);
    if !has_ramp {
        return;
    }
    let top = frame.top() + 26.0;
    let step = width / legend.colors.len() as f32;
    for (index, [red, green, blue]) in legend.colors.iter().enumerate() {
        let min = egui::pos2(left + index as f32 * step, top);
        let cell = egui::Rect::from_min_size(min, egui::vec2(step + 0.5, 12.0));
        painter.rect_filled(cell, 0.0, egui::Color32::from_rgb(*red, *green, *blue));
    }
    let number = |value: f32| format!("{value:.3}").trim_end_matches('0').trim_end_matches('.').to_owned();
    let ends = [(left, egui::Align2::LEFT_TOP, legend.low), (left + width, egui::Align2::RIGHT_TOP, legend.high)];
    for (x, align, value) in ends {
        let value = format!("{} {}", number(value), legend.unit);
        painter.text(egui::pos2(x, top + 14.0), align, value.trim(), font.clone(), egui::Color32::from_gray(235));
    }
}
