//! Mouse and keys over the picture: flying, orbiting, picking, dragging lights.

use crate::app::{App, CameraMode, Held};
use crate::gizmo::{Drag, axis_under, drag_along};
use crate::scene_overlays::{gizmo_size_m, handle};
use crate::state::{Bounces, Look, ViewState, torch};
use crate::tone::ToneMap;
use crate::views::ViewKind;
use egui::{Key, Modifiers, PointerButton};
use glam::Vec3;
use localprt_scenes::LightKind;

/// Radians per point of mouse movement.
const TURN_PER_POINT: f32 = 0.005;
/// Points around a light's place that belong to it.
const HANDLE_POINTS: f32 = 14.0;
/// Share of the focus distance that is left after one notch of the wheel.
const NOTCH: f32 = 0.85;
/// Points of scrolling per notch.
const NOTCH_POINTS: f32 = 50.0;

/// One frame of input.
pub fn interact(ui: &egui::Ui, response: &egui::Response, app: &mut App<'_>) {
    if response.clicked() || response.drag_started() {
        // Keys belong to the picture again, not to a field of the panel.
        ui.ctx().memory_mut(|memory| memory.stop_text_input());
    }
    mouse(ui, response, app);
    if !ui.ctx().text_edit_focused() {
        fly_by_keys(ui, app);
        ui.input_mut(|input| keys(input, app));
    }
}

fn mouse(ui: &egui::Ui, response: &egui::Response, app: &mut App<'_>) {
    let rect = response.rect;
    let aspect = rect.width() / rect.height().max(1.0);
    let ray = |point: egui::Pos2, app: &App<'_>| {
        let at = (point - rect.min) / rect.size().max(egui::vec2(1.0, 1.0));
        app.state.viewpoint.ray(at.x, at.y, aspect)
    };
    let pointer = response.interact_pointer_pos();
    if response.drag_started_by(PointerButton::Primary) {
        // Where the button went down, not where the drag was noticed.
        let origin = ui.input(|input| input.pointer.press_origin()).or(pointer);
        app.viewport.held = origin.and_then(|point| take_hold(app, rect, point, ray(point, app)));
    }
    if (response.drag_stopped() || !response.dragged())
        && let Some(held) = app.viewport.held.take()
    {
        app.notice = Some(told(app, held.light));
    }
    if let (Some(held), Some(point)) = (app.viewport.held, pointer) {
        move_light(app, &held, ray(point, app));
    } else if response.dragged() {
        let moved = response.drag_delta();
        let orbits = (app.viewport.mode == CameraMode::Orbit) != ui.input(|input| input.modifiers.alt);
        let viewpoint = &mut app.state.viewpoint;
        if response.dragged_by(PointerButton::Primary) {
            let (left, up) = (-moved.x * TURN_PER_POINT, -moved.y * TURN_PER_POINT);
            if orbits {
                viewpoint.orbit(left, up);
            } else {
                viewpoint.look(left, up);
            }
        } else {
            viewpoint.pan(moved.x, moved.y, rect.height());
        }
    }
    if response.hovered() {
        let scrolled = ui.input(|input| input.smooth_scroll_delta().y);
        if scrolled != 0.0 {
            let share = NOTCH.powf(scrolled / NOTCH_POINTS);
            app.state.viewpoint.approach(share, 1e-3 * app.bake.extent_m());
        }
    }
    if response.clicked()
        && let Some(point) = pointer
    {
        pick(app, rect, point, ray(point, app));
    }
}

fn fly_by_keys(ui: &egui::Ui, app: &mut App<'_>) {
    let (step, fast) = ui.input(|input| (input.stable_dt.min(0.1), input.modifiers.shift));
    let along = |forth: Key, back: Key| {
        ui.input(|input| f32::from(u8::from(input.key_down(forth))) - f32::from(u8::from(input.key_down(back))))
    };
    if ui.input(|input| input.modifiers.command || input.modifiers.alt) {
        return;
    }
    let metres = app.viewport.speed * step * if fast { 4.0 } else { 1.0 };
    let (right, up, ahead) = (along(Key::D, Key::A), along(Key::E, Key::Q), along(Key::W, Key::S));
    if (right, up, ahead) != (0.0, 0.0, 0.0) {
        app.state.viewpoint.fly(right * metres, up * metres, ahead * metres);
        ui.ctx().request_repaint();
    }
}

/// What is drawn over the picture besides the scene and the legend: names, the line at the bottom.
pub fn paint(ui: &egui::Ui, rect: egui::Rect, app: &App<'_>) {
    let painter = ui.painter_at(rect);
    if app.state.overlays.lights {
        paint_light_names(&painter, rect, app);
    }
    if app.shows_panel || app.shows_keys {
        let notice = app.notice.as_deref().unwrap_or("");
        let keys = "drag: look   W A S D Q E: fly   1-9: views   L: lights   P: probes   H: panel   F1: all keys";
        paint_line(&painter, rect, if notice.is_empty() { keys } else { notice });
    }
}
fn paint_line(painter: &egui::Painter, rect: egui::Rect, text: &str) {
    let font = egui::FontId::proportional(12.0);
    let layout = painter.layout_no_wrap(text.into(), font, egui::Color32::from_gray(225));
    let size = layout.size() + egui::vec2(16.0, 6.0);
    let corner = rect.left_bottom() - egui::vec2(0.0, size.y);
    painter.rect_filled(egui::Rect::from_min_size(corner, size), 0.0, egui::Color32::from_black_alpha(150));
    painter.galley(corner + egui::vec2(8.0, 3.0), layout, egui::Color32::WHITE);
}

fn paint_light_names(painter: &egui::Painter, rect: egui::Rect, app: &App<'_>) {
    for (index, own) in app.state.lights.iter().enumerate().filter(|(_, own)| own.on && !own.held) {
        let Some(point) = on_screen(app, rect, handle(app.bake, &own.light)) else { continue };
        let is_selected = app.state.overlays.selected_light == Some(index);
        let color = if is_selected { egui::Color32::YELLOW } else { egui::Color32::from_gray(210) };
        let at = point + egui::vec2(9.0, -9.0);
        let name = panel_name(&own.light.name, index);
        let font = egui::FontId::proportional(12.0);
        painter.text(at + egui::vec2(1.0, 1.0), egui::Align2::LEFT_BOTTOM, &name, font.clone(), egui::Color32::BLACK);
        painter.text(at, egui::Align2::LEFT_BOTTOM, &name, font, color);
    }
}

/// What a light is called in lists.
pub fn panel_name(name: &str, index: usize) -> String {
    if name.is_empty() || name.starts_with('/') { format!("light {index}") } else { name.to_owned() }
}

fn on_screen(app: &App<'_>, rect: egui::Rect, point: Vec3) -> Option<egui::Pos2> {
    let aspect = rect.width() / rect.height().max(1.0);
    let (x, y) = app.state.viewpoint.project(point, aspect)?;
    Some(rect.min + rect.size() * egui::vec2(x, y))
}

/// The shining light whose handle is under the mouse, nearest first.
fn light_under(app: &App<'_>, rect: egui::Rect, point: egui::Pos2) -> Option<usize> {
    if !app.state.overlays.lights {
        return None;
    }
    let distance = |index: usize| {
        let own = &app.state.lights[index];
        let shown = on_screen(app, rect, handle(app.bake, &own.light)).filter(|_| own.on && !own.held)?;
        Some(shown.distance(point)).filter(|&distance| distance <= HANDLE_POINTS)
    };
    (0..app.state.lights.len())
        .filter_map(|index| Some((distance(index)?, index)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, index)| index)
}

fn take_hold(app: &mut App<'_>, rect: egui::Rect, point: egui::Pos2, ray: (Vec3, Vec3)) -> Option<Held> {
    if !app.state.overlays.lights {
        return None;
    }
    let is_shown = |&light: &usize| app.state.lights.get(light).is_some_and(|own| own.on && !own.held);
    if let Some(light) = app.state.overlays.selected_light.filter(is_shown) {
        let start = handle(app.bake, &app.state.lights[light].light);
        let has_axes = app.state.lights[light].light.kind != LightKind::Directional;
        let axis = axis_under(ray, start, gizmo_size_m(&app.state, start)).filter(|_| has_axes);
        if let Some(axis) = axis {
            return Some(Held { light, drag: Drag::Axis(axis), start, start_ray: ray });
        }
    }
    let light = light_under(app, rect, point)?;
    app.state.overlays.selected_light = Some(light);
    let start = handle(app.bake, &app.state.lights[light].light);
    let plane = Drag::Plane(app.state.viewpoint.ahead());
    Some(Held { light, drag: plane, start, start_ray: ray })
}

fn move_light(app: &mut App<'_>, held: &Held, ray: (Vec3, Vec3)) {
    let moved = drag_along(held.drag, held.start, held.start_ray, ray);
    let (low, high) = app.bake.bounds;
    let Some(own) = app.state.lights.get_mut(held.light).filter(|_| moved.is_finite()) else { return };
    match own.light.kind {
        // Its handle turns around the scene.
        LightKind::Directional => {
            own.light.direction = (0.5 * (low + high) - moved).normalize_or(own.light.direction);
        }
        _ => own.light.position = moved,
    }
}

fn told(app: &App<'_>, light: usize) -> String {
    app.state.lights.get(light).map_or_else(String::new, |own| {
        let name = panel_name(&own.light.name, light);
        let at = if own.light.kind == LightKind::Directional { own.light.direction } else { own.light.position };
        format!("{name}: {:.3}, {:.3}, {:.3}", at.x, at.y, at.z)
    })
}

/// Selects a light, a probe or a receiver.
fn pick(app: &mut App<'_>, rect: egui::Rect, point: egui::Pos2, (origin, dir): (Vec3, Vec3)) {
    if let Some(light) = light_under(app, rect, point) {
        app.state.overlays.selected_light = Some(light);
        app.notice = Some(told(app, light));
        return;
    }
    let hit = app.bake.caster.closest_hit(origin, dir);
    let probe = if app.state.overlays.probes { probe_under(app, origin, dir) } else { None };
    if let Some((_, probe)) = probe.filter(|(distance, _)| hit.as_ref().is_none_or(|hit| *distance < hit.t)) {
        app.state.overlays.probe = Some(probe);
        app.notice = Some(format!("probe {probe}"));
        return;
    }
    let receiver = hit.and_then(|hit| app.bake.nearest_receiver(hit.position, hit.normal));
    app.state.overlays.receiver = receiver;
    app.notice = Some(receiver.map_or_else(
        || "there is no receiver here".into(),
        |receiver| format!("receiver {receiver}: its supporting probes are listed under \"Seeing why\""),
    ));
}

/// Distance and number of the first probe ball that a ray meets.
fn probe_under(app: &App<'_>, origin: Vec3, dir: Vec3) -> Option<(f32, u32)> {
    let radius_m = app.state.overlays.probe_size * app.bake.median_support_radius_m();
    let distance = |center: Vec3| {
        let along = (center - origin).dot(dir);
        let beside_2 = (center - origin).length_squared() - along * along;
        (along > 0.0 && beside_2 <= radius_m * radius_m).then(|| along - (radius_m * radius_m - beside_2).sqrt())
    };
    let probes = app.bake.baked.view().probes.iter().enumerate();
    probes
        .filter_map(|(index, probe)| Some((distance(probe.position.into())?, index as u32)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

/// All keys, as they are listed for the user: name, effect.
pub const KEYS: &[(&str, &str)] = &[
    ("drag", "look around (Alt or O: orbit)"),
    ("right or middle drag", "move with the picture"),
    ("wheel", "nearer and farther"),
    ("W A S D, Q E", "fly; Shift: fast"),
    ("[ ]", "fly slower, faster"),
    ("click", "pick a light, probe or receiver"),
    ("drag a light", "move it; by an arrow: along one axis"),
    ("1 ... 9", "views: final, lighting, direct, indirect, unseen, clusters, coefficients, texels, error"),
    ("L", "lights on the picture"),
    ("P", "probes on the picture"),
    ("Y", "rays of the selected probe"),
    ("F", "torch in the hand"),
    ("C", "next camera"),
    ("O", "fly or orbit"),
    ("Space", "animation"),
    ("B", "bounces: all, 1, 2, 3"),
    ("R", "forget all light and gather it again"),
    ("X", "measure the exposure again"),
    ("- +", "darker, brighter"),
    ("T", "next tone curve"),
    ("N", "normal maps"),
    ("M", "mirror reflection"),
    ("Backspace", "lights, sky and materials as at the start"),
    ("Esc", "nothing selected"),
    ("F11", "save the lighting"),
    ("F12", "save the picture"),
    ("H", "hide or show the panel"),
    ("F1", "this list"),
    ("Ctrl Q", "close"),
];

fn keys(input: &mut egui::InputState, app: &mut App<'_>) {
    if input.consume_key(Modifiers::COMMAND, Key::Q) {
        app.requests.quit = true;
    }
    // A key that is held down is pressed once.
    let mut pressed = |key: Key| {
        let is_first = |event: &egui::Event| matches!(event, egui::Event::Key { key: own, pressed: true, repeat: false, .. } if *own == key);
        let first = input.events.iter().any(is_first);
        input.consume_key(Modifiers::NONE, key) && first
    };
    const DIGITS: [Key; 9] =
        [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];
    for (key, view) in DIGITS.into_iter().zip(ViewKind::ALL) {
        if pressed(key) {
            app.show(view);
        }
    }
    if pressed(Key::H) {
        app.shows_panel = !app.shows_panel;
    }
    if pressed(Key::F1) {
        app.shows_keys = !app.shows_keys;
    }
    if pressed(Key::F11) {
        app.requests.save_lighting = true;
    }
    if pressed(Key::F12) {
        app.requests.save_picture = true;
    }
    if pressed(Key::R) {
        app.requests.reset = true;
    }
    if pressed(Key::X) {
        app.state.look.exposure = None;
        app.requests.meter = true;
    }
    if pressed(Key::Space) {
        app.state.animate = !app.state.animate;
    }
    if pressed(Key::O) {
        app.viewport.mode = if app.viewport.mode == CameraMode::Fly { CameraMode::Orbit } else { CameraMode::Fly };
    }
    if pressed(Key::OpenBracket) {
        app.viewport.speed *= 0.5;
    }
    if pressed(Key::CloseBracket) {
        app.viewport.speed *= 2.0;
    }
    if pressed(Key::C) {
        app.next_camera();
    }
    if pressed(Key::Backspace) {
        app.restore();
    }
    let overlays = &mut app.state.overlays;
    if pressed(Key::L) {
        overlays.lights = !overlays.lights;
    }
    if pressed(Key::P) {
        overlays.probes = !overlays.probes;
    }
    if pressed(Key::Y) {
        overlays.rays = !overlays.rays;
    }
    if pressed(Key::Escape) {
        (overlays.probe, overlays.receiver, overlays.selected_light) = (None, None, None);
        app.notice = None;
    }
    if pressed(Key::F) {
        toggle_torch(&mut app.state, app.bake.extent_m());
    }
    if pressed(Key::B) {
        app.state.bounces = match app.state.bounces {
            Bounces::All => Bounces::Exactly(1),
            Bounces::Exactly(bounces @ 1..=2) => Bounces::Exactly(bounces + 1),
            Bounces::Exactly(_) => Bounces::All,
        };
    }
    let ev = app.ev;
    look_keys(&mut app.state.look, ev, pressed);
}

fn look_keys(look: &mut Look, ev: f32, mut pressed: impl FnMut(Key) -> bool) {
    if pressed(Key::Minus) {
        look.exposure = Some(ev - 0.5);
    }
    if pressed(Key::Plus) || pressed(Key::Equals) {
        look.exposure = Some(ev + 0.5);
    }
    if pressed(Key::T) {
        let at = ToneMap::ALL.iter().position(|tone_map| *tone_map == look.tone_map).unwrap_or(0);
        look.tone_map = ToneMap::ALL[(at + 1) % ToneMap::ALL.len()];
    }
    if pressed(Key::N) {
        look.normal_maps = !look.normal_maps;
    }
    if pressed(Key::M) {
        look.toggle_specular();
    }
}

/// Takes the torch into the hand, or puts it away.
pub fn toggle_torch(state: &mut ViewState, extent_m: f32) {
    let at = state.lights.iter().position(|own| own.held);
    match at {
        Some(at) if state.lights[at].light.name == "torch" => {
            state.lights.remove(at);
            state.overlays.selected_light = None;
        }
        Some(at) => state.lights[at].held = false,
        None => state.lights.push(torch(&state.viewpoint, extent_m)),
    }
}
