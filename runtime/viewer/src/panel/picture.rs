//! What surfaces show, and how bright.

use super::slider;
use crate::app::App;
use crate::frame::check_view;
use crate::options::Specular;
use crate::other_light::Beside;
use crate::other_system::names;
use crate::tone::ToneMap;
use crate::views::ViewKind;

pub fn picture(ui: &mut egui::Ui, app: &mut App<'_>) {
    let shown = app.state.look.view;
    egui::ComboBox::from_label("view").selected_text(shown.name()).show_ui(ui, |ui| {
        for (index, view) in ViewKind::ALL.into_iter().enumerate() {
            let is_there = check_view(app.bake, view).is_ok();
            let label = format!("{}  {}", index + 1, view.name());
            let choice = ui.add_enabled(is_there, egui::Button::selectable(view == shown, label));
            let choice = choice
                .on_hover_text(view.about())
                .on_disabled_hover_text("run `precompute validate`, which leaves a reference beside the file");
            if choice.clicked() {
                app.show(view);
            }
        }
    });
    exposure(ui, app);
    let look = &mut app.state.look;
    egui::ComboBox::from_label("tone curve").selected_text(look.tone_map.name()).show_ui(ui, |ui| {
        for tone_map in ToneMap::ALL {
            ui.selectable_value(&mut look.tone_map, tone_map, tone_map.name());
        }
    });
    ui.checkbox(&mut look.normal_maps, "normal maps");
    ui.checkbox(&mut look.cull_backs, "leave backs out").on_hover_text("look into a room from outside");
    let mut mirrors = look.specular.is_some();
    if ui.checkbox(&mut mirrors, "mirror reflection").changed() {
        look.toggle_specular();
    }
    if let Some(specular) = &mut look.specular {
        mirror(ui, specular);
    }
    let mut has_albedo = app.state.albedo_override.is_some();
    ui.horizontal(|ui| {
        if ui.checkbox(&mut has_albedo, "one albedo for all").changed() {
            app.state.albedo_override = has_albedo.then_some(0.5);
        }
        if let Some(albedo) = &mut app.state.albedo_override {
            ui.add(slider(albedo, 0.0..=1.0));
        }
    });
    beside(ui, app);
    ui.add(slider(&mut app.render_scale, 0.25..=1.0).text("resolution"))
        .on_hover_text("pixels of the picture per pixel of the window");
    ui.horizontal(|ui| {
        if ui.button("Save picture").on_hover_text("F12").clicked() {
            app.requests.save_picture = true;
        }
        let save = ui.button("Save lighting");
        if save.on_hover_text("a file for --lights, of the viewer and of `precompute relight`").clicked() {
            app.requests.save_lighting = true;
        }
    });
}

/// Another system's light, right of a line.
fn beside(ui: &mut egui::Ui, app: &mut App<'_>) {
    if names().next().is_none() {
        return;
    }
    let own = &mut app.state.beside;
    let shown = own.map_or("none", |beside| beside.system);
    egui::ComboBox::from_label("beside the file").selected_text(shown).show_ui(ui, |ui| {
        if ui.selectable_label(own.is_none(), "none").clicked() {
            *own = None;
        }
        for system in names() {
            if ui.selectable_label(shown == system, system).clicked() {
                *own = Some(Beside { system, split: own.map_or(0.5, |beside| beside.split) });
            }
        }
    });
    if let Some(beside) = own {
        ui.add(slider(&mut beside.split, 0.0..=1.0).text("the file's share of the picture"));
        match &app.other {
            Some((_, figures)) => ui.label(figures.summary()),
            None => ui.label("its first light is being found"),
        };
    }
}

fn exposure(ui: &mut egui::Ui, app: &mut App<'_>) {
    let mut ev = app.ev;
    ui.horizontal(|ui| {
        if ui.add(slider(&mut ev, -16.0..=16.0).suffix(" EV").text("exposure")).changed() {
            app.state.look.exposure = Some(ev);
        }
        if ui.button("Measure").on_hover_text("from the picture: X").clicked() {
            app.state.look.exposure = None;
            app.requests.meter = true;
        }
    });
}

fn mirror(ui: &mut egui::Ui, specular: &mut Specular) {
    ui.indent("mirror", |ui| {
        ui.add(slider(&mut specular.f0, 0.0..=1.0).text("reflectance head on"));
        let mut own = specular.roughness.is_none();
        if ui.checkbox(&mut own, "roughness of the materials").changed() {
            specular.roughness = (!own).then_some(0.4);
        }
        if let Some(roughness) = &mut specular.roughness {
            ui.add(slider(roughness, 0.05..=1.0).text("roughness"));
        }
    });
}
