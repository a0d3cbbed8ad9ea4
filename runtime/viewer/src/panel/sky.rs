//! The first sun, and the sky.

use super::{lights, radiance, slider};
use crate::app::App;
use crate::state::{BLUE_SKY, SceneLight, new_light};
use glam::Vec3;
use localprt_scenes::{LightKind, Sky};
use std::sync::Arc;

pub fn sky(ui: &mut egui::Ui, app: &mut App<'_>) {
    let state = &mut app.state;
    match state.lights.iter_mut().find(|own| own.light.kind == LightKind::Directional) {
        Some(sun) => {
            ui.checkbox(&mut sun.on, "sun");
            lights::direction(ui, &mut sun.light.direction);
            let slider = slider(&mut sun.light.intensity, 0.0..=1e6).logarithmic(true);
            ui.add(slider.smallest_positive(1e-4).text("lux"));
        }
        None if ui.button("Add a sun").clicked() => {
            let sun = new_light(LightKind::Directional, &state.viewpoint, app.bake.extent_m());
            state.lights.push(SceneLight::new(sun));
        }
        None => {}
    }
    ui.separator();
    let mut sky = Arc::clone(&state.sky);
    kinds(ui, &mut sky, &app.first_lighting.sky);
    let mut edited = None;
    match &*sky {
        Sky::Black => {}
        Sky::Constant(color) => {
            let mut color = *color;
            if radiance(ui, "radiance", &mut color, 1e5) {
                edited = Some(Sky::Constant(color));
            }
        }
        Sky::Gradient { zenith, horizon, ground } => {
            let mut colors = [*zenith, *horizon, *ground];
            let mut changed = false;
            for (name, color) in ["zenith", "horizon", "ground"].into_iter().zip(&mut colors) {
                changed |= radiance(ui, name, color, 1e5);
            }
            let [zenith, horizon, ground] = colors;
            edited = changed.then_some(Sky::Gradient { zenith, horizon, ground });
        }
        Sky::Equirect { scale, rotation, .. } => edited = picture(ui, &sky, *scale, *rotation),
    }
    if let Some(edited) = edited {
        sky = Arc::new(edited);
    }
    state.sky = sky;
}

fn kinds(ui: &mut egui::Ui, sky: &mut Arc<Sky>, first: &Sky) {
    let kind = |sky: &Sky| match sky {
        Sky::Black => "black",
        Sky::Constant(_) => "even",
        Sky::Gradient { .. } => "gradient",
        Sky::Equirect { .. } => "picture",
    };
    let now = kind(sky);
    ui.horizontal(|ui| {
        ui.label("sky");
        for other in [Sky::Black, Sky::Constant(Vec3::ONE), BLUE_SKY] {
            if ui.selectable_label(now == kind(&other), kind(&other)).clicked() && now != kind(&other) {
                *sky = Arc::new(other);
            }
        }
        // Only the one that the viewer was started with.
        if matches!(first, Sky::Equirect { .. }) && ui.selectable_label(now == "picture", "picture").clicked() {
            *sky = Arc::new(first.clone());
        }
    });
}

fn picture(ui: &mut egui::Ui, sky: &Sky, mut scale: f32, mut rotation: f32) -> Option<Sky> {
    // Any angle may be in a file.
    rotation = (rotation + 180.0).rem_euclid(360.0) - 180.0;
    let changed = ui.add(slider(&mut scale, 0.0..=1e4).logarithmic(true).text("scale")).changed()
        | ui.add(slider(&mut rotation, -180.0..=180.0).suffix("°").text("rotation")).changed();
    let Sky::Equirect { width, height, pixels, .. } = sky else { return None };
    changed.then(|| Sky::Equirect { width: *width, height: *height, pixels: pixels.clone(), scale, rotation })
}
