//! Probes and receivers: where the light of a place comes from.

use super::slider;
use crate::app::App;
use crate::open_bake::OpenBake;
use crate::overlay_shapes::supporting_probes;

pub fn why(ui: &mut egui::Ui, app: &mut App<'_>) {
    let overlays = &mut app.state.overlays;
    ui.horizontal(|ui| {
        ui.checkbox(&mut overlays.probes, "probes").on_hover_text("balls that show their radiance: P");
        ui.add(slider(&mut overlays.probe_size, 0.01..=0.3).logarithmic(true).text("size"));
    });
    if let Some(index) = overlays.probe {
        probe(ui, app.bake, index);
        ui.checkbox(&mut app.state.overlays.rays, "its relight rays").on_hover_text("Y");
    }
    match app.state.overlays.receiver {
        Some(index) => receiver(ui, app, index),
        None => {
            ui.label("Click on a surface to see which probes light it.");
        }
    }
}

fn probe(ui: &mut egui::Ui, bake: &OpenBake<'_>, index: u32) {
    let Some(probe) = bake.baked.view().probes.get(index as usize) else { return };
    let n_clusters = bake.baked.transport().clusters.iter().filter(|cluster| cluster.probes.contains(&index)).count();
    let [x, y, z] = probe.position;
    ui.label(format!(
        "probe {index}: {x:.2}, {y:.2}, {z:.2}; support radius {:.2} m; in {n_clusters} clusters",
        probe.support_radius_m
    ));
}

fn receiver(ui: &mut egui::Ui, app: &mut App<'_>, index: u32) {
    let baked = &app.bake.baked;
    let transport = baked.transport();
    let unseen = baked.view().receiver_unseen.get(index as usize).copied().unwrap_or(0.0);
    ui.label(format!("receiver {index}: unseen {:.1} %", 100.0 * unseen));
    if let Some(number) = transport.cluster_of(index as usize) {
        let cluster = &transport.clusters[number];
        let (coefficients, receivers) = (cluster.lights.len(), cluster.receivers.len());
        ui.label(format!("cluster {number}: {coefficients} coefficients for {receivers} receivers"));
    }
    if baked.has_near_light() {
        let links = transport.links_of(index as usize);
        let irradiance: f32 = links.iter().map(|link| link.1).sum();
        let share = if transport.n_k == 1 { irradiance / std::f32::consts::PI } else { f32::NAN };
        let share = if share.is_nan() { String::new() } else { format!(", {:.1} % of its view", 100.0 * share) };
        ui.label(format!("{} links to the light map{share}", links.len()));
    }
    egui::Grid::new("supporting probes").num_columns(4).striped(true).show(ui, |ui| {
        for title in ["probe", "distance", "weight", "share of row"] {
            ui.strong(title);
        }
        ui.end_row();
        let support = supporting_probes(baked, index);
        for own in &support.probes {
            let is_selected = app.state.overlays.probe == Some(own.probe);
            if ui.selectable_label(is_selected, own.probe.to_string()).clicked() {
                app.state.overlays.probe = Some(own.probe);
            }
            ui.label(format!("{:.2} m", own.distance_m));
            ui.label(format!("{:.3}", own.kernel_weight));
            ui.label(format!("{:.1} %", 100.0 * own.row_share));
            ui.end_row();
        }
        if support.sky_share > 0.0 {
            ui.label("sky");
            ui.label("");
            ui.label("");
            ui.label(format!("{:.1} %", 100.0 * support.sky_share));
            ui.end_row();
        }
    });
}
