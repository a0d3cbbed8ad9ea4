//! Which lines a state draws over its scene.

use crate::gizmo::gizmo;
use crate::open_bake::OpenBake;
use crate::overlay_shapes::{light_shape, link_lines, probe_rays, receiver_lines, support_sphere};
use crate::overlays::OverlayLine;
use crate::stage::Stage;
use crate::state::ViewState;
use glam::Vec3;
use localprt_scenes::{Light, LightKind};

/// Most rays drawn of a probe.
const MOST_RAYS: usize = 256;
/// Size of light shapes and of their handles, as shares of their distance: the same in every picture.
const LIGHT_SHARE: f32 = 0.025;
const GIZMO_SHARE: f32 = 0.12;

/// All of them, in world space.
pub fn overlay_lines(bake: &OpenBake<'_>, state: &ViewState, stage: &Stage) -> Vec<OverlayLine> {
    let overlays = &state.overlays;
    let mut lines = Vec::new();
    if let Some(probe) = overlays.probe.filter(|&probe| (probe as usize) < bake.baked.view().probes.len()) {
        lines.extend(support_sphere(&bake.baked.view().probes[probe as usize]));
        if overlays.rays {
            lines.extend(probe_rays(bake.baked.view(), probe, MOST_RAYS));
        }
    }
    if let Some(receiver) = overlays.receiver.filter(|&it| (it as usize) < bake.baked.view().receiver_position.len()) {
        lines.extend(receiver_lines(&bake.baked, receiver));
        lines.extend(link_lines(&bake.baked, &bake.texels, receiver));
    }
    if overlays.lights {
        lines.extend(light_lines(bake, state, stage));
    }
    lines
}

fn light_lines(bake: &OpenBake<'_>, state: &ViewState, stage: &Stage) -> Vec<OverlayLine> {
    let mut lines = Vec::new();
    // The stage has the lights that shine, in the same order.
    let shining = state.lights.iter().enumerate().filter(|(_, own)| own.on);
    for ((index, own), light) in shining.zip(&stage.lights) {
        if own.held {
            continue;
        }
        let is_selected = state.overlays.selected_light == Some(index);
        let at = handle(bake, light);
        let size_m = LIGHT_SHARE * state.viewpoint.eye().distance(at);
        lines.extend(light_shape(light, at, size_m, is_selected));
        if is_selected && light.kind != LightKind::Directional {
            lines.extend(gizmo(at, gizmo_size_m(state, at), None));
        }
    }
    lines
}

/// Where a light can be taken hold of: its place, or for a sun a point above the middle of the scene.
pub fn handle(bake: &OpenBake<'_>, light: &Light) -> Vec3 {
    match light.kind {
        LightKind::Directional => {
            let (low, high) = bake.bounds;
            0.5 * (low + high) - 0.4 * bake.extent_m() * light.direction
        }
        _ => light.position,
    }
}

/// Length of the handles of a light, metres.
pub fn gizmo_size_m(state: &ViewState, position: Vec3) -> f32 {
    GIZMO_SHARE * state.viewpoint.eye().distance(position)
}
