//! Balls and a door that block light, and a ball that is lit.

use super::{radiance, slider, vector};
use crate::app::App;
use crate::state::{Ball, Door, LitObject};
use glam::Vec3;
use localprt_runtime::MAX_OCCLUDERS;

pub fn things(ui: &mut egui::Ui, app: &mut App<'_>) {
    ui.checkbox(&mut app.state.animate, "animation").on_hover_text("Space");
    if app.bake.baked.view().ray_distance.is_empty() {
        ui.label("This file has no ray distances: balls and door throw shadows, but block no indirect light.");
    }
    let (bake, extent_m) = (app.bake, app.bake.extent_m());
    let state = &mut app.state;
    let viewpoint = state.viewpoint;

    ui.separator();
    let most = MAX_OCCLUDERS - usize::from(state.door.is_some());
    if ui.add_enabled(state.balls.len() < most, egui::Button::new("Add a black ball")).clicked() {
        state.balls.push(Ball::new(bake, &viewpoint));
    }
    let mut removed = None;
    for (index, ball) in state.balls.iter_mut().enumerate() {
        ui.push_id(index, |ui| {
            vector(ui, "center, m", &mut ball.center, 2e-3 * extent_m);
            ui.horizontal(|ui| {
                radius(ui, &mut ball.radius_m, extent_m);
                ui.checkbox(&mut ball.circles, "moves");
                if ui.button("Remove").clicked() {
                    removed = Some(index);
                }
            });
        });
    }
    if let Some(index) = removed {
        state.balls.remove(index);
    }

    ui.separator();
    let mut has_door = state.door.is_some();
    let may_have_door = has_door || state.balls.len() < MAX_OCCLUDERS;
    if ui.add_enabled(may_have_door, egui::Checkbox::new(&mut has_door, "door")).changed() {
        state.door = has_door.then(|| Door::new(bake, &viewpoint));
    }
    if let Some(door) = &mut state.door {
        door_sliders(ui, door, extent_m);
    }

    ui.separator();
    let mut has_object = state.object.is_some();
    if ui.checkbox(&mut has_object, "lit ball").on_hover_text("shows the light of the place where it is").changed() {
        state.object = has_object.then(|| LitObject::new(bake, &viewpoint));
    }
    if let Some(object) = &mut state.object {
        vector(ui, "center, m", &mut object.center, 2e-3 * extent_m);
        radius(ui, &mut object.radius_m, extent_m);
        radiance(ui, "albedo", &mut object.albedo, 1.0);
        radiance(ui, "emission", &mut object.emission, 1e3);
        ui.checkbox(&mut object.circles, "moves");
        if app.bake.baked.view().volume.is_none() {
            ui.label("This file has no volume: the ball is lit by the probes around it, which know no walls.");
        }
    }
}

fn radius(ui: &mut egui::Ui, radius_m: &mut f32, extent_m: f32) {
    let range = 1e-3 * extent_m..=0.3 * extent_m;
    ui.add(egui::DragValue::new(radius_m).speed(1e-3 * extent_m).range(range).prefix("radius ").suffix(" m"));
}

fn door_sliders(ui: &mut egui::Ui, door: &mut Door, extent_m: f32) {
    vector(ui, "hinge, m", &mut door.hinge, 2e-3 * extent_m);
    vector(ui, "size, m", &mut door.size_m, 1e-3 * extent_m);
    door.size_m = door.size_m.max(Vec3::splat(1e-4 * extent_m));
    ui.add(slider(&mut door.direction, -180.0..=180.0).suffix("°").text("direction"));
    ui.add(slider(&mut door.open, 0.0..=180.0).suffix("°").text("open"));
    radiance(ui, "albedo", &mut door.albedo, 1.0);
    ui.checkbox(&mut door.swings, "swings");
}
