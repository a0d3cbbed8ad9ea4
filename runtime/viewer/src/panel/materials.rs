//! Albedo and emission of materials.

use super::radiance;
use crate::app::App;
use glam::Vec3;
use localprt_scenes::MaterialOverride;

pub fn materials(ui: &mut egui::Ui, app: &mut App<'_>) {
    let state = &mut app.state;
    ui.horizontal(|ui| {
        ui.label(format!("{} changed", state.materials.len()));
        if ui.button("All as in the scene").clicked() {
            state.materials.clear();
        }
    });
    for material in &app.bake.scene().materials {
        let is_changed = state.materials.contains_key(&material.name);
        let title = if is_changed { format!("{} *", material.name) } else { material.name.clone() };
        egui::CollapsingHeader::new(title).id_salt(&material.name).show(ui, |ui| {
            let mut own = state.materials.get(&material.name).copied().unwrap_or_default();
            material_sliders(ui, &mut own, material.base_color.truncate(), material.emission);
            if own == MaterialOverride::default() {
                state.materials.remove(&material.name);
            } else {
                state.materials.insert(material.name.clone(), own);
            }
        });
    }
}

fn material_sliders(ui: &mut egui::Ui, own: &mut MaterialOverride, albedo: Vec3, emission: Vec3) {
    let mut has_albedo = own.albedo.is_some();
    if ui.checkbox(&mut has_albedo, "albedo").on_hover_text("replaces color and texture").changed() {
        own.albedo = has_albedo.then(|| albedo.clamp(Vec3::ZERO, Vec3::ONE));
    }
    if let Some(albedo) = &mut own.albedo {
        radiance(ui, "albedo", albedo, 1.0);
    }
    let mut has_emission = own.emission.is_some();
    if ui.checkbox(&mut has_emission, "emission").on_hover_text("replaces color and texture").changed() {
        own.emission = has_emission.then_some(if emission == Vec3::ZERO { Vec3::ONE } else { emission });
    }
    if let Some(emission) = &mut own.emission {
        radiance(ui, "W/(sr m²)", emission, 1e5);
    }
}
