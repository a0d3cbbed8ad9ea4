//! SSGI with dynamic light probes: SH probes around the camera that learn from a few hundred pixels of each frame.
//!
//! Source: Wang, Bowles and Weeks 2022, Screen Space Global Illumination with Dynamic Light Probes.
//!
//! | element | of the paper | file | test |
//! |---|---|---|---|
//! | progressive projection, by the error | Eqs. (6), (8) | `projection` | `the_error_finds_what_three_bands_hold_exactly` |
//! | the same as a recursive filter | Eqs. (7), (9) | `projection` | `the_filter_does_too_with_the_noise_of_its_samples` |
//! | solid angles as weights | Eqs. (7), (11) | `projection` | `large_solid_angles_weigh_more` |
//! | hysteresis | below Eq. (9) | `projection` | `hysteresis_trades_speed_for_noise` |
//! | convergence to the static projection | Figs. 4, 5, sec. 7.1 | `convergence` | `the_static_error_falls_with_the_root_of_the_samples_and_the_filters_to_its_floor`, `regular_samples_bring_both_together_pass_by_pass` |
//! | 20 x 20 stratified samples of the frame buffer | sec. 5.1, 6.1 | `frame_buffer` | `one_pixel_per_tile_is_less_noisy_than_as_many_anywhere` |
//! | area of a pixel | Eq. (10) | `frame_buffer` | `areas_sum_to_what_the_camera_sees_of_a_plane` |
//! | least cosine of 0.01 | below Eq. (10) | `frame_buffer` | `grazing_views_count_as_a_cosine_of_a_hundredth` |
//! | solid angle from a probe | Eq. (11) | `frame_buffer` | `solid_angles_sum_to_that_of_the_plane_from_any_camera` |
//! | all probes from all samples | sec. 5.1 | this | `probes_learn_from_all_that_is_on_screen` |
//! | area lights | sec. 5.2 | `sources` | `emissive_surfaces_off_screen_are_injected` |
//! | environment | sec. 5.2 | `sources` | `the_sky_is_injected` |
//! | bounces through the next frame | sec. 5.1 | this | `bounces_come_with_the_frames` |
//! | cascades around the camera, not copied | sec. 6.2 | `cascades` | `cascades_reach_far`, `light_moves_with_the_grid_until_samples_correct_it` |
//! | jittered probes | sec. 6.2 | `cascades` | `jitter_takes_the_grid_out_of_the_light` |
//! | three bands in seven fp16 textures | sec. 6.3 | this | `coefficients_are_kept_in_half_precision` |
//! | rays between samples and probes | sec. 7.3 | this | `light_in_a_sealed_room_leaks_without_occlusion_rays_alone` |
//! | what is off screen fades | sec. 7.3 | this | `light_that_leaves_the_screen_fades` |
//! | dependence on the view | sec. 2.1 | this | `light_depends_on_the_view` |
//!
//! Differs from the paper:
//!
//! - Weights of the filter's first term are shares of the sphere, without which all is `4 pi` too dark: [`Rule::Filter`].
//! - Steps and solid angles are held to what they can be at most, or one sample next to a probe would overshoot:
//!   [`Coefficients::step`], [`PixelSample::arriving`]. It costs the light of patches that are nearer than they are wide.
//! - A sample stands for its whole tile, where the paper speaks of a pixel, so that solid angles sum to what is seen. Theirs are smaller
//!   by the pixels of a tile, 5184, which a hysteresis takes up.
//! - Area lights are drawn by area times radiance, all of them for every probe, without a structure that finds near ones: noisier where
//!   there are many.
//! - The area lights' and the sky's samples make one step together, after that of the screen. A black sky is none and is not injected.
//! - Coefficients are rounded to fp16 once a frame; sums are f32.
//! - Probes are read across the borders of cascades without a seam, about which the paper says nothing.
//! - Black backs of one-sided surfaces are black samples, where a rasterizer would see through them.
//! - Eq. (10) has the distance along the ray for its depth z: with the depth along the camera's axis areas would be too small off it.
//! - In comparisons grids stay within the scene's box ([`Settings::within_scene`]): around a camera that looks in from outside, half of the
//!   probes and more would stand where nobody reads them, or in walls.
//! - A frame without a camera is seen by those of the setup in turn, and its grids stay around the middle of the scene. Without any, the
//!   screen is empty, and only sources are injected.
//!
//! Found, and not mended because it is the method's own: the filter takes what is off screen to look like what is on it. Probes that
//! see half of all directions make irradiance up to twice what it is, an area light beside a floor four times, and bounces of walls of
//! an albedo of 0.8 grow without end. Correcting the error itself, [`SSGI_PROBES_ERROR`], has none of this in a closed room (within 4 % of
//! the first bounce in the two rooms), but light that is off screen hardly fades.

pub mod cascades;
pub mod convergence;
pub mod frame_buffer;
pub mod projection;
pub mod sources;
#[cfg(test)]
mod tests;

use crate::{Frame, Kind, Query, Setup, ShaderHarmonics, ShaderLight, System, Work, World};
use cascades::Cascades;
use frame_buffer::{FrameBuffer, PixelSample};
use glam::{UVec2, Vec3};
use localprt_formats::{directions::counter_hash, quantize::to_f16, sh::Basis};
use localprt_scenes::Camera;
use projection::{Arriving, Coefficients, DEGREE, FUNCTIONS, Filter, Rule};
use rayon::prelude::*;
use sources::{SourceSettings, Sources};

/// Bytes of a probe: a texel in each of seven textures of four fp16 values, for 27 coefficients.
const PROBE_BYTES: u64 = 7 * 4 * 2;
/// The largest finite fp16.
const LARGEST_F16: f32 = 65504.0;

/// The method as the paper proposes it for devices of low performance: without visibility.
pub const SSGI_PROBES: Kind = Kind {
    name: "ssgi-probes",
    title: "SSGI with dynamic light probes",
    source: "Wang, Bowles and Weeks 2022",
    probe_bytes: PROBE_BYTES,
    follows_camera: true,
    averaged_frames: 0,
    prepare: |world, setup| Box::new(SsgiProbes::new(world, setup, Settings::COMPARED)),
};

/// The same by the error itself, which the paper derives and then simplifies: [`Rule::Error`].
pub const SSGI_PROBES_ERROR: Kind = Kind {
    name: "ssgi-probes-error",
    title: "SSGI with dynamic light probes, error not simplified",
    source: "Wang, Bowles and Weeks 2022, Eq. (8)",
    probe_bytes: PROBE_BYTES,
    follows_camera: true,
    averaged_frames: 0,
    prepare: |world, setup| {
        let filter = Filter { rule: Rule::Error, ..Settings::COMPARED.filter };
        Box::new(SsgiProbes::new(world, setup, Settings { filter, ..Settings::COMPARED }))
    },
};

/// The variant with rays between samples and probes.
pub const SSGI_PROBES_OCCLUSION: Kind = Kind {
    name: "ssgi-probes-occlusion",
    title: "SSGI with dynamic light probes, occlusion rays",
    source: "Wang, Bowles and Weeks 2022, sec. 7.3",
    probe_bytes: PROBE_BYTES,
    follows_camera: true,
    averaged_frames: 0,
    prepare: |world, setup| Box::new(SsgiProbes::new(world, setup, Settings { occlusion: true, ..Settings::COMPARED })),
};

/// What the user of the method sets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Where samples are taken.
    pub frame_buffer: FrameBuffer,
    /// How probes follow them.
    pub filter: Filter,
    /// What is injected.
    pub sources: SourceSettings,
    /// Nested grids.
    pub cascades: usize,
    /// Grids stay within the scene's box, half a cell from its sides, wherever the camera is; otherwise they are around the camera alone.
    pub within_scene: bool,
    /// Whether probes are updated from anywhere in their cells.
    pub jitter: bool,
    /// Whether rays ask if a probe sees a sample.
    pub occlusion: bool,
}

impl Settings {
    /// The paper's 20 x 20 samples. It leaves the other numbers open: a picture of 1080 rows; a hysteresis with which light that is seen
    /// from a quarter of all directions has a memory of 40 frames, about that of DDGI; two cascades; as many samples of sources as are
    /// cheap beside 400; no preference for sources or screen.
    ///
    /// Of the two rules the paper's sec. 5.1 tells the one and runs the other, [`Rule::Filter`].
    pub const PAPER: Self = Self {
        frame_buffer: FrameBuffer { size: UVec2::new(1920, 1080), tiles: UVec2::splat(20) },
        filter: Filter { rule: Rule::Filter, hysteresis: 0.1 },
        sources: SourceSettings { light_samples: 16, sky_samples: 16, weight: 1.0 },
        cascades: 2,
        within_scene: false,
        jitter: true,
        occlusion: false,
    };

    /// For comparisons: no probe where nobody reads it, or in a wall; a screen of the shape of the views that are compared; and as "magic
    /// number" (sec. 5.2) the one that is about right for an area light beside a floor.
    pub const COMPARED: Self = Self {
        frame_buffer: FrameBuffer { size: UVec2::new(1440, 1080), ..Self::PAPER.frame_buffer },
        sources: SourceSettings { weight: 0.2, ..Self::PAPER.sources },
        within_scene: true,
        ..Self::PAPER
    };
}

impl Default for Settings {
    fn default() -> Self {
        Self::PAPER
    }
}

/// The probes and their light.
pub struct SsgiProbes {
    settings: Settings,
    seed: u64,
    basis: Basis,
    cascades: Cascades,
    /// Views of frames that have none.
    cameras: Vec<Camera>,
    /// Where the grids stand in frames without a camera, metres.
    middle: Vec3,
    /// `[n_probes]`, without light at first.
    coefficients: Vec<Coefficients>,
}

/// Random numbers of a frame, by what they are for.
#[derive(Clone, Copy)]
enum Purpose {
    Pixels,
    Jitter,
    Sources,
}

impl SsgiProbes {
    /// Probes in grids of which the widest covers the scene: from where it is, or, if grids are around the camera alone, from the setup's
    /// cameras and from its middle, up to half a spacing.
    pub fn new(world: &World<'_>, setup: &Setup<'_>, settings: Settings) -> Self {
        let (low, high) = world.bounds();
        let middle = (low + high) * 0.5;
        let reach = |eye: Vec3| (eye - low).abs().max((high - eye).abs());
        let eyes = setup.cameras.iter().map(|camera| camera.to_world.w_axis.truncate());
        let reach = eyes.fold(reach(middle), |most, eye| most.max(reach(eye)));
        let cascades = match settings.within_scene {
            true => Cascades::within((low, high), setup.probes, settings.cascades),
            false => Cascades::new(middle, reach, setup.probes, settings.cascades),
        };
        let coefficients = vec![Coefficients::default(); cascades.probes()];
        let cameras = setup.cameras.to_vec();
        Self { settings, seed: setup.seed, basis: Basis::new(DEGREE), cascades, cameras, middle, coefficients }
    }

    /// The view of a frame: its own, or the next one of the setup.
    fn view<'a>(&'a self, frame: &Frame<'a>) -> Option<&'a Camera> {
        frame.camera.or_else(|| self.cameras.get((frame.number % self.cameras.len().max(1) as u64) as usize))
    }

    fn key(&self, frame: &Frame<'_>, purpose: Purpose) -> u64 {
        counter_hash(self.seed, purpose as u64, frame.number)
    }
}

impl System for SsgiProbes {
    fn update(&mut self, frame: &Frame<'_>) -> Work {
        let Settings { frame_buffer, filter, occlusion, .. } = self.settings;
        self.cascades.follow(frame.camera.map_or(self.middle, |camera| camera.to_world.w_axis.truncate()));
        let view = self.view(frame);
        let lit = view.map(|camera| frame_buffer.samples(self, frame, camera, self.key(frame, Purpose::Pixels)));
        let (samples, mut work) = lit.unwrap_or_default();
        let sources = Sources::of(frame.world, self.settings.sources);
        let jitter = self.settings.jitter.then(|| self.key(frame, Purpose::Jitter));
        let source_key = self.key(frame, Purpose::Sources);
        let Self { basis, cascades, coefficients, .. } = self;
        let update = |(probe, own): (usize, &mut Coefficients)| {
            let place = cascades.position(probe, jitter);
            let (seen, screen_rays) = splat(frame.world, &samples, place, occlusion);
            own.step(basis, seen.into_iter(), &filter);
            let key = counter_hash(source_key, 0, probe as u64);
            let (injected, source_rays) = sources.arriving(place, key, occlusion);
            own.step(basis, injected.into_iter(), &filter);
            *own = in_half_precision(own);
            screen_rays + source_rays
        };
        work.rays += coefficients.par_iter_mut().enumerate().map(update).sum::<u64>();
        work.probes = coefficients.len() as u64;
        work.texels = work.probes * 3 * FUNCTIONS as u64;
        work
    }

    fn irradiance(&self, _: &World<'_>, query: &Query<'_>) -> Vec<Vec3> {
        let at = |shaded: &crate::Shaded| {
            let mut light = Coefficients::default();
            self.cascades.around(shaded.point.position, |probe, weight| {
                light.0.iter_mut().zip(self.coefficients[probe].0).for_each(|(sum, own)| *sum += own * weight);
            });
            light.irradiance(shaded.point.normal)
        };
        query.points.par_iter().map(at).collect()
    }

    fn shader_light(&self) -> Option<ShaderLight> {
        let coefficients = self.coefficients.iter().map(|own| own.0).collect();
        Some(ShaderLight::Harmonics(ShaderHarmonics { grids: self.cascades.grids().to_vec(), coefficients }))
    }

    fn probes(&self) -> usize {
        self.coefficients.len()
    }

    fn bytes(&self) -> u64 {
        self.coefficients.len() as u64 * PROBE_BYTES
    }
}

/// What arrives at a probe of the samples that face it, and the rays that it took: those that `occlusion` asks for.
fn splat(world: &World<'_>, samples: &[PixelSample], probe: Vec3, occlusion: bool) -> (Vec<Arriving>, u64) {
    let (mut arriving, mut rays) = (Vec::with_capacity(samples.len()), 0);
    for sample in samples {
        let Some(light) = sample.arriving(probe) else { continue };
        rays += u64::from(occlusion);
        if !occlusion || sample.is_seen_from(world, probe) {
            arriving.push(light);
        }
    }
    (arriving, rays)
}

/// Coefficients as fp16 textures hold them, to 2^-12 of each; larger ones than these have are the largest.
fn in_half_precision(coefficients: &Coefficients) -> Coefficients {
    let kept = |value: f32| to_f16(value.clamp(-LARGEST_F16, LARGEST_F16)).map_or(0.0, f32::from);
    Coefficients(coefficients.0.map(|value| Vec3::from(value.to_array().map(kept))))
}
