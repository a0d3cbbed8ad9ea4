//! The list of lights, and the selected one.

use super::{slider, vector};
use crate::app::App;
use crate::state::{SceneLight, new_light};
use crate::viewport::{panel_name, toggle_torch};
use glam::Vec3;
use localprt_scenes::{Light, LightKind, Lighting};

/// Half angles of a spot that was another light before, radians.
const SPOT: LightKind = LightKind::Spot { inner_cone: 0.3, outer_cone: 0.6 };

pub fn lights(ui: &mut egui::Ui, app: &mut App<'_>) {
    presets(ui, app);
    let extent_m = app.bake.extent_m();
    let state = &mut app.state;
    let mut selected = state.overlays.selected_light;
    egui::ScrollArea::vertical().id_salt("lights").max_height(140.0).show(ui, |ui| {
        for (index, own) in state.lights.iter_mut().enumerate() {
            ui.horizontal(|ui| {
                ui.checkbox(&mut own.on, "");
                let name = panel_name(&own.light.name, index);
                let is_selected = selected == Some(index);
                if ui.selectable_label(is_selected, format!("{name}, {}", kind_name(own.light.kind))).clicked() {
                    selected = (!is_selected).then_some(index);
                }
            });
        }
    });
    ui.horizontal(|ui| {
        ui.label("add");
        for (name, kind) in [("point", LightKind::Point), ("spot", SPOT), ("sun", LightKind::Directional)] {
            if ui.button(name).clicked() {
                state.lights.push(SceneLight::new(new_light(kind, &state.viewpoint, extent_m)));
                selected = Some(state.lights.len() - 1);
                state.overlays.lights = true;
            }
        }
        let is_held = state.lights.iter().any(|own| own.held);
        if ui.selectable_label(is_held, "torch").on_hover_text("F").clicked() {
            toggle_torch(state, extent_m);
            selected = selected.filter(|_| is_held == state.lights.iter().any(|own| own.held));
        }
    });
    ui.checkbox(&mut state.overlays.lights, "on the picture").on_hover_text("L");
    if let Some(index) = selected.filter(|&index| index < state.lights.len()) {
        ui.separator();
        light(ui, &mut state.lights[index], extent_m);
        if ui.button("Remove").clicked() {
            state.lights.remove(index);
            selected = None;
        }
    }
    state.overlays.selected_light = selected.filter(|&index| index < state.lights.len());
}

fn presets(ui: &mut egui::Ui, app: &mut App<'_>) {
    ui.horizontal_wrapped(|ui| {
        if ui.button("As at the start").on_hover_text("lights, sky and materials: Backspace").clicked() {
            app.restore();
        }
        let own = ui.button("The scene's own").on_hover_text("its lights under a black sky");
        if own.clicked() {
            app.state.set_lighting(&Lighting::of_scene(app.bake.scene()));
        }
        if ui.button("None").clicked() {
            app.state.lights.clear();
            app.state.overlays.selected_light = None;
        }
    });
}

fn kind_name(kind: LightKind) -> &'static str {
    match kind {
        LightKind::Point => "point",
        LightKind::Spot { .. } => "spot",
        LightKind::Directional => "sun",
    }
}

fn light(ui: &mut egui::Ui, own: &mut SceneLight, extent_m: f32) {
    let light = &mut own.light;
    let kind = light.kind;
    egui::ComboBox::from_label("type").selected_text(kind_name(kind)).show_ui(ui, |ui| {
        for other in [LightKind::Point, SPOT, LightKind::Directional] {
            let is_this = kind_name(other) == kind_name(kind);
            if ui.selectable_label(is_this, kind_name(other)).clicked() && !is_this {
                change_kind(light, other, extent_m);
            }
        }
    });
    ui.horizontal(|ui| {
        let mut color = light.color.to_array();
        if ui.color_edit_button_rgb(&mut color).changed() {
            light.color = color.into();
        }
        let is_sun = light.kind == LightKind::Directional;
        let most = if is_sun { 1e6 } else { 1e4 * extent_m * extent_m };
        let slider = slider(&mut light.intensity, 0.0..=most).logarithmic(true).smallest_positive(1e-4);
        ui.add(slider.text(if is_sun { "lux" } else { "candela" }));
    });
    if light.kind != LightKind::Directional && !own.held {
        vector(ui, "position, m", &mut light.position, 2e-3 * extent_m);
    }
    if light.kind != LightKind::Point && !own.held {
        direction(ui, &mut light.direction);
    }
    if let LightKind::Spot { inner_cone, outer_cone } = &mut light.kind {
        let mut degrees = [inner_cone.to_degrees(), outer_cone.to_degrees()];
        let changed = ui.add(slider(&mut degrees[0], 0.0..=89.0).suffix("°").text("inner cone")).changed()
            | ui.add(slider(&mut degrees[1], 1.0..=90.0).suffix("°").text("outer cone")).changed();
        if changed {
            *outer_cone = degrees[1].to_radians();
            *inner_cone = degrees[0].to_radians().min(*outer_cone - 1e-3).max(0.0);
        }
    }
    ui.horizontal(|ui| {
        if light.kind != LightKind::Directional {
            ui.checkbox(&mut own.held, "in the hand");
        }
        ui.checkbox(&mut own.circles, "moves").on_hover_text("while the animation runs: Space");
    });
}

/// Another type at the same brightness a quarter of the scene away.
fn change_kind(light: &mut Light, kind: LightKind, extent_m: f32) {
    let candela_per_lux = (0.25 * extent_m).powi(2);
    match (light.kind == LightKind::Directional, kind == LightKind::Directional) {
        (true, false) => light.intensity *= candela_per_lux,
        (false, true) => light.intensity /= candela_per_lux,
        _ => {}
    }
    light.kind = kind;
    light.direction = light.direction.normalize_or(Vec3::NEG_Y);
}

/// Where light goes, as two angles: compass direction that it comes from, and height over the horizon.
pub fn direction(ui: &mut egui::Ui, direction: &mut Vec3) {
    let from = -direction.normalize_or(Vec3::NEG_Y);
    let mut height = from.y.clamp(-1.0, 1.0).asin().to_degrees();
    let mut compass = from.x.atan2(-from.z).to_degrees().rem_euclid(360.0);
    let changed = ui.add(slider(&mut height, -90.0..=90.0).suffix("°").text("from above")).changed()
        | ui.add(slider(&mut compass, 0.0..=360.0).suffix("°").text("from the side")).changed();
    if changed {
        // At the pole there is no side; a little off it the angle is kept.
        let (height, compass) = (height.clamp(-89.99, 89.99).to_radians(), compass.to_radians());
        *direction = -Vec3::new(height.cos() * compass.sin(), height.sin(), -height.cos() * compass.cos());
    }
}
