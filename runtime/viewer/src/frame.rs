//! From a state to a picture: what changed goes to the relighter and the drawing passes, then both record a frame.

use crate::exposure::Meter;
use crate::gpu::Gpu;
use crate::objects::moving_casters;
use crate::open_bake::OpenBake;
use crate::options::DrawOptions;
use crate::other_light::OtherLight;
use crate::overlays::{OverlayLine, Overlays, ProbeSpheres};
use crate::receiver_maps::{Legend, receiver_map};
use crate::scene_draw::SceneDraw;
use crate::stage::Stage;
use crate::state::{Bounces, Look, ViewState};
use crate::target::OffscreenTarget;
use crate::tone::ToneMap;
use crate::views::ViewKind;
use localprt_runtime::gpu::Timestamps;
use localprt_runtime::passes::shadow_map::shadow_views;
use localprt_runtime::scene_light::material_overrides;
use localprt_runtime::{
    DirectLight, DirectOptions, PassTime, RelightError, Relighter, RelighterOptions, ShadowCasters, sky_sh,
};
use localprt_scenes::{Light, Lighting, MaterialOverride, Sky};
use localprt_tools::error::{CommandError, Exit};
#[cfg(not(target_arch = "wasm32"))]
use localprt_tools::picture::Exposure;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest shadow map, texels per side: over a building of 40 m, a centimetre each.
const SHADOW_MAP_SIZE: u32 = 4096;
/// Smallest one worth having.
const SMALLEST_SHADOW_MAP: u32 = 256;
/// Bytes that all shadow maps together may take before they are made smaller.
const SHADOW_BYTES: u64 = 512 << 20;
/// Room for lights to be added before everything has to be set up again: a point light.
const SPARE_LAYERS: u32 = 6;
/// Frames after a start at which the exposure is measured again: light is still arriving, and has after the last of them.
const METERED_FRAMES: [u64; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Everything on the GPU that the pictures of one open bake need.
pub struct Renderer {
    gi: Relighter,
    draw: SceneDraw,
    overlays: Overlays,
    target: OffscreenTarget,
    timestamps: Option<Timestamps>,
    meter: Meter,
    applied: Applied,
    shadow_layers: u32,
    /// Exposure value in force.
    ev: f32,
    /// A measurement is due, and waits for the one before it if that is on its way.
    must_meter: bool,
    /// The exposure has come after the picture.
    is_behind: bool,
    /// Frames since the light was reset.
    frames: u64,
    legend: Option<Legend>,
    times: Vec<PassTime>,
}

/// What the GPU has been told.
#[derive(Default)]
struct Applied {
    lights: Option<Vec<Light>>,
    stage: Option<Stage>,
    materials: Option<(BTreeMap<String, MaterialOverride>, Option<f32>)>,
    sky: Option<Arc<Sky>>,
    look: Option<(Look, Option<f32>)>,
    other: Option<Arc<OtherLight>>,
}

impl Renderer {
    /// Uploads an open bake, for pictures of `size` pixels with room for these lights.
    ///
    /// # Errors
    /// Exit code 5 if the device is too small.
    pub fn new(
        gpu: &Gpu,
        bake: &OpenBake<'_>,
        lights: &[Light],
        (width, height): (u32, u32),
    ) -> Result<Self, CommandError> {
        let (device, queue) = (&gpu.device, &gpu.queue);
        let direct = shadow_options(device, bake, lights)?;
        let options = RelighterOptions { direct, ..RelighterOptions::default() };
        let mut gi = Relighter::new(device, queue, &bake.baked, options).map_err(refused)?;
        gi.set_texels(&bake.texels, &bake.casters).map_err(refused)?;
        let draw = SceneDraw::new(device, queue, bake.scene(), &gi, DrawOptions::default())
            .map_err(|error| CommandError::of(Exit::Internal, &error).help(error.help()))?;
        let renderer = Self {
            overlays: Overlays::new(device, &gi, bake.baked.view()),
            target: OffscreenTarget::new(device, width, height),
            timestamps: Timestamps::new(device, queue),
            meter: Meter::default(),
            applied: Applied::default(),
            shadow_layers: direct.shadow_layers,
            ev: 0.0,
            must_meter: true,
            is_behind: false,
            frames: 0,
            legend: None,
            times: Vec::new(),
            gi,
            draw,
        };
        match gpu.take_error() {
            Some(error) => Err(too_small(&error)),
            None => Ok(renderer),
        }
    }

    /// Another picture size, at least one pixel.
    pub fn resize(&mut self, gpu: &Gpu, (width, height): (u32, u32)) {
        if self.target.size() != (width, height) {
            self.target = OffscreenTarget::new(&gpu.device, width, height);
        }
    }

    /// Forgets all light.
    pub fn reset(&mut self) {
        self.gi.reset();
        self.frames = 0;
    }

    /// Another system's light, for the part of the picture that a state gives it.
    pub fn set_other(&mut self, gpu: &Gpu, light: &Arc<OtherLight>) {
        if !self.applied.other.as_ref().is_some_and(|last| Arc::ptr_eq(last, light)) {
            self.draw.set_other(&gpu.device, &gpu.queue, light);
            self.applied.other = Some(Arc::clone(light));
        }
    }

    /// Measures the exposure from the next picture, where it is not set by hand.
    pub fn meter_again(&mut self) {
        self.must_meter = true;
    }

    /// Whether one more frame of the same would have the same exposure.
    pub fn is_metered(&self, look: &Look) -> bool {
        !is_auto(look) || !(self.is_behind || self.must_meter) && self.meter.is_idle()
    }

    /// One frame into the target: gathers light, draws, develops.
    ///
    /// # Errors
    /// A state that the passes refuse, or a device that is too small for it.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        bake: &OpenBake<'_>,
        state: &ViewState,
        stage: &Stage,
        lines: &[OverlayLine],
    ) -> Result<(), CommandError> {
        if needed_layers(bake, &stage.lights) > self.shadow_layers {
            let mut larger = Self::new(gpu, bake, &stage.lights, self.target.size())?;
            (larger.ev, larger.must_meter, larger.frames) = (self.ev, self.must_meter, self.frames);
            let other = self.applied.other.take();
            *self = larger;
            if let Some(other) = other {
                self.set_other(gpu, &other);
            }
        }
        self.apply(gpu, bake, state, stage)?;
        self.set_overlays(gpu, bake, state, lines);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        self.gi.encode(&mut encoder, &DirectLight::Lights).map_err(refused)?;
        gpu.queue.submit([encoder.finish()]);
        self.frames += 1;

        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.begin_frame();
        }
        self.is_behind = false;
        let is_auto = is_auto(&state.look);
        self.must_meter |= is_auto && METERED_FRAMES.contains(&self.frames);
        let meters = is_auto && self.must_meter;
        let has_overlays = !lines.is_empty() || state.overlays.probes;
        if meters && has_overlays {
            // The light of the scene counts, and not what is drawn over it.
            self.draw_scene(gpu, bake, state, false, &mut encoder)?;
            self.must_meter &= !self.meter.encode(&gpu.device, &mut encoder, &self.target);
        }
        self.draw_scene(gpu, bake, state, true, &mut encoder)?;
        if meters && !has_overlays {
            self.must_meter &= !self.meter.encode(&gpu.device, &mut encoder, &self.target);
        }
        self.develop(gpu, state, &mut encoder);
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.end_frame(&mut encoder);
        }
        gpu.queue.submit([encoder.finish()]);
        if let Some(ev) = self.meter.take() {
            self.is_behind = ev != self.ev;
            self.ev = ev;
        }
        self.collect_times();
        Ok(())
    }

    fn draw_scene(
        &mut self,
        gpu: &Gpu,
        bake: &OpenBake<'_>,
        state: &ViewState,
        with_overlays: bool,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), CommandError> {
        let view = state.viewpoint.view(bake.extent_m());
        let span = self.timestamps.as_mut().and_then(|timestamps| timestamps.reserve("scene"));
        let writes =
            span.zip(self.timestamps.as_ref()).map(|((begin, end), timestamps)| wgpu::RenderPassTimestampWrites {
                query_set: timestamps.queries(),
                beginning_of_pass_write_index: Some(begin),
                end_of_pass_write_index: Some(end),
            });
        self.overlays.set_exposure(self.scale(&state.look));
        self.overlays.set_tone_curve(!state.look.view.is_map());
        self.draw
            .encode(&gpu.queue, encoder, &self.gi, &view, &self.target, with_overlays.then_some(&self.overlays), writes)
            .map_err(|error| CommandError::of(Exit::Internal, &error).help(error.help()))
    }

    fn develop(&self, gpu: &Gpu, state: &ViewState, encoder: &mut wgpu::CommandEncoder) {
        let tone_map = if state.look.view.is_map() { ToneMap::Clamp } else { state.look.tone_map };
        let split = split(state);
        self.target.tone_map_split(&gpu.queue, encoder, self.scale(&state.look), tone_map, split);
    }

    /// 2^EV.
    fn scale(&self, look: &Look) -> f32 {
        if look.view.is_map() { 1.0 } else { look.exposure.unwrap_or(self.ev).exp2() }
    }

    /// The picture, three bytes a pixel, top row first. Waits for the GPU. A measured exposure is that of this very
    /// picture, of all its pixels.
    ///
    /// # Errors
    /// A device that is lost.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn read_picture(&mut self, gpu: &Gpu, bake: &OpenBake<'_>, state: &ViewState) -> Result<Vec<u8>, CommandError> {
        let (device, queue) = (&gpu.device, &gpu.queue);
        if is_auto(&state.look) {
            let mut encoder = device.create_command_encoder(&Default::default());
            self.draw_scene(gpu, bake, state, false, &mut encoder)?;
            queue.submit([encoder.finish()]);
            self.ev = Exposure::Auto.ev(&self.target.read_radiance(device, queue).map_err(refused)?);
            let mut encoder = device.create_command_encoder(&Default::default());
            self.draw_scene(gpu, bake, state, true, &mut encoder)?;
            self.develop(gpu, state, &mut encoder);
            queue.submit([encoder.finish()]);
        }
        self.target.read_srgb(device, queue).map_err(refused)
    }

    /// What changed since the last frame.
    fn apply(&mut self, gpu: &Gpu, bake: &OpenBake<'_>, state: &ViewState, stage: &Stage) -> Result<(), CommandError> {
        let (device, queue) = (&gpu.device, &gpu.queue);
        match state.bounces {
            Bounces::All => self.gi.set_bounces(1),
            Bounces::Exactly(bounces) => {
                self.gi.set_bounces(bounces);
                self.gi.reset();
            }
        }
        if self.applied.lights.as_ref() != Some(&stage.lights) {
            self.gi.set_lights(&stage.lights);
            self.applied.lights = Some(stage.lights.clone());
        }
        if self.applied.stage.as_ref().is_none_or(|last| last.objects != stage.objects) {
            let occluders = if bake.baked.view().ray_distance.is_empty() { &[] } else { stage.occluders.as_slice() };
            self.gi.set_occluders(occluders).map_err(refused)?;
            let casters =
                if stage.objects.is_empty() { ShadowCasters::default() } else { moving_casters(&stage.objects) };
            self.gi.set_moving_casters(&casters).map_err(refused)?;
            self.draw.set_objects(device, queue, &stage.objects);
            self.applied.stage = Some(stage.clone());
        }
        let materials = (&state.materials, state.albedo_override);
        if self.applied.materials.as_ref().is_none_or(|(own, albedo)| (own, *albedo) != materials) {
            let lighting = Lighting { materials: state.materials.clone(), ..Lighting::default() };
            let overrides = material_overrides(bake.scene(), &lighting);
            self.gi.set_materials(&overrides, state.albedo_override).map_err(refused)?;
            self.draw.set_materials(queue, &overrides, state.albedo_override);
            self.applied.materials = Some((state.materials.clone(), state.albedo_override));
        }
        if self.applied.sky.as_ref().is_none_or(|sky| !Arc::ptr_eq(sky, &state.sky)) {
            let sky = &state.sky;
            let sh = if sky.is_black() { Vec::new() } else { sky_sh(sky, bake.baked.view().metadata.sky_degree) };
            self.gi.set_sky(&sh, &[]).map_err(refused)?;
            self.draw.set_sky(device, queue, sky);
            self.applied.sky = Some(Arc::clone(sky));
        }
        self.apply_look(gpu, bake, &state.look, split(state));
        Ok(())
    }

    fn apply_look(&mut self, gpu: &Gpu, bake: &OpenBake<'_>, look: &Look, split: Option<f32>) {
        let last = self.applied.look.replace((*look, split));
        if last == Some((*look, split)) {
            return;
        }
        let last = last.map(|(last, _)| last);
        self.draw.set_options(DrawOptions {
            view: look.view,
            normal_maps: look.normal_maps,
            specular: look.specular,
            cull_backs: look.cull_backs,
            split,
        });
        if last.map(|last| last.view) != Some(look.view) {
            let map = receiver_map(look.view, &bake.baked, bake.files.reference.as_ref());
            if let Some(map) = &map {
                self.draw.set_receiver_map(&gpu.device, &gpu.queue, map);
            }
            self.legend = map.map(|map| map.legend);
        }
        if last.is_some_and(|last| last.exposure.is_some()) && look.exposure.is_none() {
            self.must_meter = true;
        }
    }

    fn set_overlays(&mut self, gpu: &Gpu, bake: &OpenBake<'_>, state: &ViewState, lines: &[OverlayLine]) {
        self.overlays.set_lines(&gpu.device, &gpu.queue, lines);
        let highlighted = || state.overlays.probe.into_iter().map(|probe| (probe, 1.0)).collect();
        let spheres = state.overlays.probes.then(|| ProbeSpheres {
            radius_m: state.overlays.probe_size * bake.median_support_radius_m(),
            highlighted: highlighted(),
        });
        self.overlays.set_probes(&gpu.queue, spheres);
    }

    fn collect_times(&mut self) {
        let relight = self.gi.pass_times();
        let drawn = self.timestamps.as_mut().and_then(Timestamps::take);
        // Either comes when it comes; times of one name replace the last ones.
        for time in relight.into_iter().chain(drawn).flatten() {
            match self.times.iter_mut().find(|known| known.name == time.name) {
                Some(known) => *known = time,
                None => self.times.push(time),
            }
        }
    }

    /// The picture on the GPU.
    pub fn target(&self) -> &OffscreenTarget {
        &self.target
    }

    /// Exposure value in force.
    pub fn ev(&self, look: &Look) -> f32 {
        look.exposure.unwrap_or(self.ev)
    }

    /// Gathers since the light was reset.
    pub fn gathers(&self) -> u64 {
        self.gi.gathers()
    }

    /// What the colors of a map view mean.
    pub fn legend(&self) -> Option<&Legend> {
        self.legend.as_ref()
    }

    /// GPU time of every pass when it was last known; empty on devices without timestamps.
    pub fn times(&self) -> &[PassTime] {
        &self.times
    }

    /// Device memory of the relighter by purpose, bytes.
    pub fn memory(&self) -> Vec<(&'static str, u64)> {
        self.gi.memory()
    }
}

/// Where the picture is split, as a share of its width: maps of the file show nothing of other systems.
fn split(state: &ViewState) -> Option<f32> {
    state.beside.filter(|_| !state.look.view.is_map()).map(|beside| beside.split)
}

/// Whether an open bake can show a view.
///
/// # Errors
/// Whether the exposure is measured.
fn is_auto(look: &Look) -> bool {
    look.exposure.is_none() && !look.view.is_map()
}

/// The error view without a reference that `validate` left beside the file.
pub fn check_view(bake: &OpenBake<'_>, view: ViewKind) -> Result<(), CommandError> {
    if view != ViewKind::Error || bake.files.reference.is_some() {
        return Ok(());
    }
    let what = bake.files.reference_note.clone().unwrap_or_else(|| "there is no reference beside it".into());
    let help = format!("run `precompute validate {} -o DIR`, which leaves one", bake.files.path.display());
    Err(CommandError::new(Exit::InvalidInput, what).in_file(&bake.files.path).help(help))
}

fn needed_layers(bake: &OpenBake<'_>, lights: &[Light]) -> u32 {
    let bounds = bake.casters.bounds();
    lights.iter().map(|light| shadow_views(light, &bounds, SHADOW_MAP_SIZE).len() as u32).sum()
}

/// Layers for these lights and some more, at the largest size that stays within [`SHADOW_BYTES`].
fn shadow_options(device: &wgpu::Device, bake: &OpenBake<'_>, lights: &[Light]) -> Result<DirectOptions, CommandError> {
    let needed = needed_layers(bake, lights);
    let allowed = device.limits().max_texture_array_layers;
    if needed > allowed {
        let what = format!("the lights need {needed} shadow maps, this device has {allowed} at a time");
        let help = "show fewer point lights: a point light takes six maps, a spot or sun one";
        return Err(CommandError::new(Exit::Unsupported, what).help(help));
    }
    let shadow_layers = (needed + SPARE_LAYERS).min(allowed);
    let bytes = |size: u32| 4 * u64::from(size) * u64::from(size) * u64::from(shadow_layers);
    let mut shadow_map_size = SHADOW_MAP_SIZE;
    while bytes(shadow_map_size) > SHADOW_BYTES && shadow_map_size > SMALLEST_SHADOW_MAP {
        shadow_map_size /= 2;
    }
    Ok(DirectOptions { shadow_map_size, shadow_layers })
}

fn refused(error: RelightError) -> CommandError {
    match &error {
        RelightError::Device { reason } => too_small(reason),
        RelightError::Limit { .. } => too_small(&error.to_string()),
        _ => CommandError::of(Exit::InvalidInput, &error).help(error.help()),
    }
}

/// A device that gave up for a reason, as the user sees it.
pub fn too_small(reason: &str) -> CommandError {
    CommandError::new(Exit::Unsupported, format!("the graphics device gave up: {reason}"))
        .help("close other programs that use it, or bake with a larger --texel")
}
