//! One lighting state, measured: reference, methods, parts of the error, steps, leak and views.

use super::{
    MeasureSettings,
    edges::{Edges, is_at_edge},
    flip::mean_flip,
    last_leg::{TruthLeg, truth_leg},
    lit::light,
    methods::{self, ByMethod, COMPRESSED, Method, PAPER, UNCOMPRESSED},
    mottling::Mottling,
    parts::{ErrorParts, Worst, parts},
    path_tracer::{Estimates, PathTracer, PixelLight, ViewLight, ViewSettings},
    seen::{SeenError, SeenPoint, SeenReference},
    selection::{Pairs, spread, thin},
    steps::Steps,
    subject::Subject,
    surface_pixels::{SurfacePixel, SurfacePixels},
};
use crate::metrics::{MethodError, mean};
use crate::reference_file::{ReferenceFile, ReferencePoint};
use crate::{error::BakeError, picture::Exposure, progress::Progress};
use glam::Vec3;
use localprt_formats::BakedView;
use localprt_runtime::{CoverageMap, LightMaps, passes::gutter_dilation::gutter_dilation};
use localprt_scenes::{Camera, Lighting, luminance};
use serde::Serialize;

/// Rows of a picture, at most: a tall camera must not take all memory.
const MOST_ROWS: u32 = 2048;

/// Pixels per row of the pictures that FLIP compares, at most. With few paths per pixel FLIP is mostly noise: in the Cornell
/// box, eight bounces, halves of a reference of 30 million paths are 0.032 apart at 480 pixels per row, 0.015 at 160.
pub const FLIP_WIDTH: u32 = 128;
/// Paths per pixel of those pictures before their noise is measured first.
const FIRST_FLIP_PATHS: u32 = 512;
/// FLIP between the halves of a reference that is smooth enough.
pub const FLIP_NOISE: f64 = 0.01;

/// Receivers whose reference is below this times the mean get no light to speak of: what they show is leak.
const SEALED: f64 = 1e-4;

/// A lighting state to validate under.
#[derive(Clone, Debug)]
pub struct State {
    /// Name as shown: a file name, or what it is.
    pub name: String,
    /// What shines.
    pub lighting: Lighting,
    /// Whether a quality limit applies to it.
    pub counts: bool,
}

/// Where the lightmap is compared with path tracing as it is seen, whatever the lighting.
#[derive(Clone, Debug, Default)]
pub struct SeenPoints {
    /// By view.
    pub views: Vec<Vec<SeenPoint>>,
    /// By area.
    pub area: Vec<SeenPoint>,
}

/// Light at receivers that get none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Leak {
    /// Measured receivers whose reference is below 1e-4 of the mean.
    pub receivers: usize,
    /// Mean of the compressed light there over the mean of the reference everywhere; luminance.
    pub mean: f64,
    /// Largest of the same.
    pub max: f64,
}

/// A camera's view: light, pictures, errors.
#[derive(Clone, Debug)]
pub struct View {
    /// Name of the camera.
    pub camera: String,
    /// Light of its primary rays, to look at.
    pub light: ViewLight,
    /// The same of fewer pixels with many more paths, one primary ray each, for FLIP.
    pub smooth: ViewLight,
    /// Exposure of its pictures.
    pub ev: f32,
    /// The lightmap where the camera sees it.
    pub error: SeenError,
    /// The points of that comparison.
    pub seen: SeenReference,
    /// Light beside edges, by [`View::smooth`].
    pub edges: Edges,
    /// Blotches on smooth surfaces, by the same.
    pub mottling: Mottling,
    /// Which pixels of [`View::smooth`] those figures are of.
    pub shown: Shown,
    /// FLIP of the compressed light.
    pub flip: f64,
    /// FLIP between two independent halves of the reference, which have twice the noise of the whole.
    pub flip_noise: f64,
}

/// Pixels at edges and on smooth surfaces.
#[derive(Clone, Debug, Default)]
pub struct Shown {
    /// Whether each pixel is at an edge.
    pub at_edge: Vec<bool>,
    /// Error less the mean around, over the mean of the reference around; NaN where it is not measured.
    pub deviation: Vec<f32>,
}

/// What was found of one method.
#[derive(Clone, Debug)]
pub struct MethodFindings {
    /// Irradiance at the measured receivers, W m^-2.
    pub irradiance: Vec<Vec3>,
    /// What a picture is lit by.
    pub maps: LightMaps,
    /// Errors at the measured receivers.
    pub error: MethodError,
}

/// Everything measured under one lighting state.
#[derive(Debug)]
pub struct StateFindings {
    /// The state.
    pub state: State,
    /// Reference at the measured receivers.
    pub reference: Estimates,
    /// Mean irradiance of the file after every gather, W m^-2.
    pub gather_means: Vec<f64>,
    /// Mean of the reference over receivers and bands, W m^-2.
    pub mean: f64,
    /// The same of its luminance.
    pub mean_luminance: f64,
    /// From the truth to the transport row at the measured receivers.
    pub truths: Vec<TruthLeg>,
    /// By method.
    pub methods: ByMethod<MethodFindings>,
    /// What the error is made of.
    pub parts: ErrorParts,
    /// Reasons of the worst receivers.
    pub worst: Worst,
    /// Steps across borders.
    pub steps: Steps,
    /// Light where there should be none.
    pub leak: Leak,
    /// Views.
    pub views: Vec<View>,
    /// The lightmap at points drawn by area.
    pub area: SeenError,
    /// The points of that comparison.
    pub area_seen: SeenReference,
    /// Mean of [`View::flip_noise`]: what noise alone gives, and more.
    pub flip_noise: f64,
}

/// Measures one state at the receivers `sample`, in file order.
///
/// `None` where no light reaches any receiver.
///
/// # Errors
/// Those of the relight; [`BakeError::Cancelled`].
pub fn measure(
    subject: &Subject<'_>,
    state: &State,
    sample: &[u32],
    pairs: &Pairs,
    cameras: &[Camera],
    seen_points: &SeenPoints,
    settings: &MeasureSettings,
    progress: &Progress,
) -> Result<Option<StateFindings>, BakeError> {
    let lighting = &state.lighting;
    let lit = light(subject, lighting, settings.bounces, progress)?;
    let tracer = PathTracer::new(subject.caster, lighting, settings.bounces, settings.seed);
    let points: Vec<_> = sample.iter().map(|&receiver| subject.sites(receiver)).collect();
    let reference = tracer.estimate_means(&points, settings.budget, progress)?;
    let mean = mean(&reference.irradiance);
    if mean <= 0.0 || mean.is_nan() {
        return Ok(None);
    }
    let unseen: Vec<Vec3> = subject.view.receiver_unseen.iter().map(|&share| Vec3::splat(share)).collect();
    let unseen = irradiance_map(subject, &unseen);
    let seen_error = |points: &[SeenPoint]| {
        let surface: Vec<_> = points.iter().map(|seen| seen.point).collect();
        let reference = tracer.estimate(&surface, settings.budget, progress)?;
        let error = SeenError::of(points, &lit.relit.maps, &unseen, &reference);
        Ok::<_, BakeError>((error, SeenReference { points: points.to_vec(), reference }))
    };
    let mut views = views(&tracer, cameras, settings, progress)?;
    for ((view, camera), points) in views.iter_mut().zip(cameras).zip(&seen_points.views) {
        (view.error, view.seen) = seen_error(points)?;
        view.flip = view.flip(&lit.relit.maps);
        view.measure_surfaces(subject, camera, &lit.relit.maps);
    }
    let (area, area_seen) = seen_error(&seen_points.area)?;

    // Receivers that the sample, the pairs and the pictures need, each once.
    let seen = thin(&seen_receivers(subject, &views), settings.picture_receivers as usize);
    let mut needed: Vec<u32> = sample.iter().copied().chain(pairs.receivers()).chain(seen).collect();
    needed.sort_unstable();
    needed.dedup();
    let compared = methods::compare(&lit, &needed, progress)?;
    let place = |receiver: u32| needed.binary_search(&receiver).expect("measured receivers are among those needed");
    let methods = compared.light.map(|light| {
        let irradiance: Vec<Vec3> = sample.iter().map(|&receiver| light.irradiance[place(receiver)]).collect();
        let interpolated =
            || LightMaps::of_irradiance(irradiance_map(subject, &spread(subject, &needed, &light.irradiance)));
        let maps = light.maps.clone().unwrap_or_else(interpolated);
        let flip = views.iter().map(|view| view.flip(&maps)).sum::<f64>() / views.len().max(1) as f64;
        let error = MethodError::of(&irradiance, &reference.irradiance).unwrap_or_default();
        MethodFindings { irradiance, maps, error: MethodError { flip, ..error } }
    });

    // With one bounce the reference is the first bounce.
    let first_bounce = match settings.bounces {
        1 => reference.irradiance.clone(),
        _ => {
            let tracer = PathTracer::new(subject.caster, lighting, 1, settings.seed ^ 0xf157);
            tracer.estimate_means(&points, settings.budget, progress)?.irradiance
        }
    };
    let truths = truth_leg(&lit, sample, &first_bounce, progress)?;
    let near: Vec<f32> = sample.iter().map(|&receiver| compared.near[place(receiver)]).collect();
    let measured = |method: &Method| methods.of(method).irradiance.as_slice();
    let (compressed, rows) = (measured(&COMPRESSED), measured(&UNCOMPRESSED));
    let (parts, worst) =
        parts(&truths, &near, rows, compressed, &reference.irradiance, &reference.standard_error, mean);
    let mean_luminance =
        reference.irradiance.iter().map(|&color| luminance(color)).sum::<f64>() / sample.len().max(1) as f64;
    let by = |method: &Method| {
        let light = &compared.light.of(method).irradiance;
        move |receiver: u32| luminance(light[place(receiver)])
    };
    let steps = Steps::of(pairs, by(&COMPRESSED), by(&UNCOMPRESSED), by(&PAPER), mean_luminance);
    let leak = leak(compressed, &reference.irradiance, mean_luminance);
    let flip_noise = views.iter().map(|view| view.flip_noise).sum::<f64>() / views.len().max(1) as f64;
    Ok(Some(StateFindings {
        state: state.clone(),
        reference,
        gather_means: lit.gather_means.clone(),
        mean,
        mean_luminance,
        truths,
        methods,
        parts,
        worst,
        steps,
        leak,
        views,
        area,
        area_seen,
        flip_noise,
    }))
}

fn views(
    tracer: &PathTracer<'_>,
    cameras: &[Camera],
    settings: &MeasureSettings,
    progress: &Progress,
) -> Result<Vec<View>, BakeError> {
    let view = |camera: &Camera| {
        let aspect = camera.aspect.filter(|aspect| (0.1..=10.0).contains(aspect)).unwrap_or(4.0 / 3.0);
        let size = |width: u32, rays_per_axis: u32, paths: u32| ViewSettings {
            width,
            height: ((width as f32 / aspect).round() as u32).clamp(1, MOST_ROWS),
            rays_per_axis,
            paths,
        };
        let light =
            tracer.view(camera, size(settings.picture_width, 2, settings.picture_paths.div_ceil(4)), progress)?;
        let width = settings.picture_width.min(FLIP_WIDTH);
        let mut paths = settings.flip_paths.min(FIRST_FLIP_PATHS);
        let mut smooth = tracer.view(camera, size(width, 1, paths), progress)?;
        let reference = |light: &ViewLight| light.picture(|light| light.radiance(light.reference()));
        let ev = loop {
            let ev = Exposure::Auto.ev(&reference(&smooth).pixels);
            if noise(&smooth, ev) <= FLIP_NOISE || 2 * paths > settings.flip_paths {
                break ev;
            }
            tracer.add_paths(&mut smooth, paths, progress)?;
            paths *= 2;
        };
        let flip_noise = noise(&smooth, ev);
        Ok(View {
            camera: camera.name.clone(),
            light,
            smooth,
            ev,
            error: SeenError::default(),
            seen: SeenReference::default(),
            edges: Edges::default(),
            mottling: Mottling::default(),
            shown: Shown::default(),
            flip: 0.0,
            flip_noise,
        })
    };
    cameras.iter().map(view).collect()
}

/// FLIP between the two halves.
fn noise(light: &ViewLight, ev: f32) -> f64 {
    let half = |half: usize| light.picture(|light| light.radiance(light.indirect[half]));
    mean_flip(&half(0), &half(1), ev)
}

impl View {
    /// Edges and smooth surfaces with indirect light from maps.
    fn measure_surfaces(&mut self, subject: &Subject<'_>, camera: &Camera, maps: &LightMaps) {
        let surfaces = SurfacePixels::of(subject, camera, &self.smooth, maps);
        let above = |pixel: &SurfacePixel| pixel.position + pixel.geometric_normal * subject.caster.offset_m();
        self.edges = Edges::of(&surfaces, |from, to| subject.caster.visible(above(from), above(to)));
        let n_pixels = self.smooth.rays.len();
        (self.mottling, self.shown.deviation) = Mottling::of(&surfaces, n_pixels);
        self.shown.at_edge = vec![false; n_pixels];
        for pixel in surfaces.pixels.iter().filter(|pixel| is_at_edge(pixel)) {
            self.shown.at_edge[pixel.pixel as usize] = true;
        }
    }

    /// Mean FLIP against the reference of a picture with indirect light from maps.
    pub(super) fn flip(&self, maps: &LightMaps) -> f64 {
        let picture = self.smooth.picture(|light| light.radiance(sampled(maps, light)));
        mean_flip(&picture, &self.smooth.picture(|light| light.radiance(light.reference())), self.ev)
    }
}

/// Indirect irradiance that maps hold at what a primary ray met; none where it reflects no light.
pub fn sampled(maps: &LightMaps, light: &PixelLight) -> Vec3 {
    let found =
        light.uv.zip(light.point).and_then(|(uv, point)| maps.irradiance_about(point.normal, |map| map.sample(uv)));
    found.unwrap_or(Vec3::ZERO)
}

/// Values at `[n_receivers]` as a map to be read bilinearly, gutters filled.
pub fn irradiance_map(subject: &Subject<'_>, values: &[Vec3]) -> CoverageMap {
    let mut map = CoverageMap::uncovered(subject.view.metadata.lightmap_size);
    gutter_dilation(&subject.checked, values, &mut map);
    map
}

/// Receivers in whose texels the views' primary rays end.
fn seen_receivers(subject: &Subject<'_>, views: &[View]) -> Vec<u32> {
    let mut seen: Vec<u32> =
        views.iter().flat_map(|view| &view.light.rays).filter_map(|light| subject.receiver_at(light.uv?)).collect();
    seen.sort_unstable();
    seen.dedup();
    seen
}

/// Light where the reference has none; `mean` is the mean luminance of the reference.
pub(super) fn leak(compressed: &[Vec3], reference: &[Vec3], mean: f64) -> Leak {
    let brightness = |color: &Vec3| luminance(*color);
    let sealed: Vec<f64> = compressed
        .iter()
        .zip(reference)
        .filter(|(_, reference)| brightness(reference) < SEALED * mean)
        .map(|(compressed, _)| brightness(compressed) / mean)
        .collect();
    Leak {
        receivers: sealed.len(),
        // The sum of nothing is -0.0, which reads badly.
        mean: sealed.iter().sum::<f64>() / sealed.len().max(1) as f64 + 0.0,
        max: sealed.iter().copied().fold(0.0, f64::max),
    }
}

impl StateFindings {
    /// What was found at the receivers `sample`, in file order, as it is kept beside the baked file.
    pub fn reference_file(
        &self,
        content_hash: [u8; 32],
        view: &BakedView<'_>,
        sample: &[u32],
        bounces: u32,
    ) -> ReferenceFile {
        let values = self.reference.irradiance.iter().zip(self.compressed());
        let point = |(&receiver, (reference, compressed)): (&u32, (&Vec3, &Vec3))| ReferencePoint {
            receiver,
            position: view.receiver_position[receiver as usize],
            reference: reference.to_array(),
            compressed: compressed.to_array(),
        };
        let points = sample.iter().zip(values).map(point).collect();
        ReferenceFile { content_hash, state: self.state.name.clone(), bounces, points }
    }

    /// Compressed irradiance at the measured receivers.
    pub fn compressed(&self) -> &[Vec3] {
        &self.methods.of(&COMPRESSED).irradiance
    }

    /// `E - E_ref` of its luminance, W m^-2.
    pub fn luminance_errors(&self) -> impl Iterator<Item = f64> {
        let pairs = self.compressed().iter().zip(&self.reference.irradiance);
        pairs.map(|(&found, &reference)| luminance(found) - luminance(reference))
    }
}
