//! The panel: everything that can be set, in the order in which one asks for it.

mod figures;
pub mod legend;
mod lights;
mod materials;
mod picture;
mod sky;
mod things;
mod why;

pub use figures::{Figures, History};

use crate::app::{App, CameraMode};
use crate::state::Bounces;
use crate::viewport::KEYS;
use glam::Vec3;

/// The whole panel.
pub fn panel(ui: &mut egui::Ui, app: &mut App<'_>, figures: &Figures<'_>) {
    let name = app.bake.files.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    ui.horizontal(|ui| {
        ui.heading(name);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            if ui.button("Keys").on_hover_text("F1").clicked() {
                app.shows_keys = !app.shows_keys;
            }
        });
    });
    figures::summary(ui, figures);
    ui.separator();
    egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        section(ui, "Picture", true, |ui| picture::picture(ui, app));
        section(ui, "Camera", true, |ui| camera(ui, app));
        section(ui, "Lights", true, |ui| lights::lights(ui, app));
        section(ui, "Seeing why", true, |ui| why::why(ui, app));
        section(ui, "Sun and sky", false, |ui| sky::sky(ui, app));
        section(ui, "Materials", false, |ui| materials::materials(ui, app));
        section(ui, "Things that move", false, |ui| things::things(ui, app));
        section(ui, "Bounces", false, |ui| bounces(ui, app));
        section(ui, "Figures", false, |ui| figures::figures(ui, app, figures));
    });
}

fn section(ui: &mut egui::Ui, title: &str, is_open: bool, contents: impl FnOnce(&mut egui::Ui)) {
    egui::CollapsingHeader::new(title).default_open(is_open).show(ui, contents);
}

fn camera(ui: &mut egui::Ui, app: &mut App<'_>) {
    ui.horizontal_wrapped(|ui| {
        for (index, camera) in app.bake.cameras.iter().enumerate() {
            let name = if camera.name.is_empty() { format!("camera {index}") } else { camera.name.clone() };
            if ui.button(name).clicked() {
                app.go_to_camera(index);
            }
        }
    });
    ui.horizontal(|ui| {
        ui.selectable_value(&mut app.viewport.mode, CameraMode::Fly, "fly");
        ui.selectable_value(&mut app.viewport.mode, CameraMode::Orbit, "orbit");
    });
    let extent_m = app.bake.extent_m();
    ui.add(
        slider(&mut app.viewport.speed, 0.005 * extent_m..=2.0 * extent_m)
            .logarithmic(true)
            .suffix(" m/s")
            .text("speed"),
    );
    let mut degrees = app.state.viewpoint.fov_y.to_degrees();
    if ui.add(slider(&mut degrees, 10.0..=120.0).suffix("°").text("field of view")).changed() {
        app.state.viewpoint.fov_y = degrees.to_radians();
    }
}

fn bounces(ui: &mut egui::Ui, app: &mut App<'_>) {
    let mut all = app.state.bounces == Bounces::All;
    let mut exactly = if let Bounces::Exactly(bounces) = app.state.bounces { bounces } else { 1 };
    ui.horizontal(|ui| {
        ui.selectable_value(&mut all, true, "all").on_hover_text("one gather per frame on top of all earlier ones");
        ui.selectable_value(&mut all, false, "exactly").on_hover_text("so many gathers from darkness, every frame");
        ui.add_enabled(!all, egui::DragValue::new(&mut exactly).range(1..=16).clamp_existing_to_range(false));
    });
    app.state.bounces = if all { Bounces::All } else { Bounces::Exactly(exactly) };
    if ui.button("Forget all light").on_hover_text("R").clicked() {
        app.requests.reset = true;
    }
}

/// The list of keys.
pub fn keys_window(ctx: &egui::Context, is_open: &mut bool) {
    egui::Window::new("Mouse and keys").open(is_open).resizable(false).show(ctx, |ui| {
        egui::Grid::new("keys").num_columns(2).striped(true).show(ui, |ui| {
            for (key, effect) in KEYS {
                ui.strong(*key);
                ui.label(*effect);
                ui.end_row();
            }
        });
    });
}

/// A slider that leaves values beyond its ends alone until they are edited.
fn slider<Number: egui::emath::Numeric>(
    value: &mut Number,
    range: std::ops::RangeInclusive<Number>,
) -> egui::Slider<'_> {
    egui::Slider::new(value, range).clamping(egui::SliderClamping::Edits)
}

/// Places farther than this are typing mistakes, metres.
const FARTHEST_M: f32 = 1e9;

/// Three numbers in a row.
fn vector(ui: &mut egui::Ui, label: &str, value: &mut Vec3, speed: f32) {
    ui.horizontal(|ui| {
        let mut edited = *value;
        for axis in 0..3 {
            ui.add(egui::DragValue::new(&mut edited[axis]).speed(speed).max_decimals(3));
        }
        ui.label(label);
        // Numbers can be typed that are none, or lead nowhere.
        if edited.abs().max_element() < FARTHEST_M {
            *value = edited;
        }
    });
}

/// A color of any brightness: its hue as a button, its largest band as a logarithmic slider.
fn radiance(ui: &mut egui::Ui, label: &str, value: &mut Vec3, most: f32) -> bool {
    let mut strength = value.max_element();
    let mut hue = if strength > 0.0 { (*value / strength).to_array() } else { [1.0; 3] };
    let mut changed = false;
    ui.horizontal(|ui| {
        if ui.color_edit_button_rgb(&mut hue).changed() {
            // The button chooses the color, the slider how much of it.
            let most = hue.iter().copied().fold(0.0, f32::max);
            hue = if most > 0.0 { hue.map(|band| band / most) } else { [1.0; 3] };
            changed = true;
        }
        changed |=
            ui.add(slider(&mut strength, 0.0..=most).logarithmic(true).smallest_positive(1e-3).text(label)).changed();
    });
    if changed {
        *value = Vec3::from(hue) * strength;
    }
    changed
}
