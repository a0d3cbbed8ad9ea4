//! Pictures without a window.

use crate::camera_path::camera_path;
use crate::cli::Cli;
use crate::frame::{Renderer, too_small};
use crate::gpu::Gpu;
use crate::open_bake::OpenBake;
use crate::other_system::{Engine, Found, Moment, OtherFigures, UPDATES, engine};
use crate::receiver_maps::Legend;
use crate::scene_overlays::overlay_lines;
use crate::stage::Stage;
use crate::state::ViewState;
use localprt_tools::error::CommandError;
use localprt_tools::output::{OutputError, check_writable, write_png};
use localprt_tools::picture::PictureSize;
use std::path::Path;
use std::sync::Arc;
use web_time::Instant;

/// Frames before a screenshot unless given: as many gathers as `precompute relight` makes.
const FRAMES: u32 = 8;
/// Frames of a recording unless given.
const RECORDED_FRAMES: u32 = 120;
/// Of a recording.
const FRAMES_PER_SECOND: f32 = 30.0;

/// Pictures of an open bake.
pub struct Headless<'a> {
    /// What is shown.
    pub bake: &'a OpenBake<'a>,
    /// How.
    pub state: ViewState,
    /// Pixels.
    pub size: (u32, u32),
}

/// Updates a system under light that stays, until it says the same twice.
fn settle(other: &mut Engine<'_>, moment: &Moment, updates: u32) {
    let mut last = None;
    for _ in 0..updates {
        let light = Some(other.update(moment).light);
        if light == last {
            break;
        }
        last = light;
    }
}

/// Who makes the pictures of a run.
struct Drawn<'a> {
    gpu: &'a Gpu,
    renderer: &'a mut Renderer,
    other: Option<Engine<'a>>,
}

impl Headless<'_> {
    /// What the command line asks for, without a window.
    ///
    /// # Errors
    /// No adapter, a device that is too small, a file that cannot be written.
    pub fn run(&mut self, cli: &Cli, started: Instant) -> Result<(), CommandError> {
        if let Some(path) = &cli.screenshot {
            check_writable(path)?;
        }
        let gpu = Gpu::headless()?;
        let mut renderer = self.renderer(&gpu)?;
        eprintln!("{}", self.bake.summary(&gpu.name(), started.elapsed()));
        let mut other = engine(self.bake, &self.state);
        let counts_updates = cli.frames.is_some() && cli.record.is_none();
        if let Some(other) = other.as_mut().filter(|_| !counts_updates) {
            // One more update goes with each frame.
            settle(other, &self.moment(0.0), UPDATES - FRAMES);
        }
        let mut drawn = Drawn { gpu: &gpu, renderer: &mut renderer, other };
        match (&cli.screenshot, &cli.record) {
            (_, Some(folder)) => self.record(&mut drawn, folder, cli.frames.unwrap_or(RECORDED_FRAMES), cli.still),
            (Some(path), None) => self.screenshot(&mut drawn, path, cli.frames.unwrap_or(FRAMES)),
            (None, None) => Ok(()),
        }
    }

    fn screenshot(&mut self, drawn: &mut Drawn<'_>, path: &Path, n_frames: u32) -> Result<(), CommandError> {
        let mut figures = None;
        for frame in 0..n_frames {
            figures = self.frame(drawn, frame as f32 / FRAMES_PER_SECOND)?;
        }
        if let Some(figures) = figures {
            eprintln!("beside the file: {}", figures.summary());
        }
        self.describe(drawn.renderer);
        let pixels = drawn.renderer.read_picture(drawn.gpu, self.bake, &self.state)?;
        write_png(path, self.size.0, self.size.1, &pixels)?;
        Ok(())
    }

    fn record(
        &mut self,
        drawn: &mut Drawn<'_>,
        folder: &Path,
        n_frames: u32,
        is_still: bool,
    ) -> Result<(), CommandError> {
        std::fs::create_dir_all(folder).map_err(|error| OutputError::write(folder, error))?;
        check_writable(&folder.join("frame_00000.png"))?;
        let start = self.state.viewpoint;
        for frame in 0..n_frames {
            if !is_still {
                self.state.viewpoint = camera_path(self.bake, &start, frame as f32 / n_frames as f32);
            }
            // Light has arrived, and the exposure of the first picture is that of all.
            let n_gathers = if frame == 0 { FRAMES } else { 1 };
            for _ in 0..n_gathers {
                self.frame(drawn, frame as f32 / FRAMES_PER_SECOND)?;
            }
            let pixels = drawn.renderer.read_picture(drawn.gpu, self.bake, &self.state)?;
            if frame == 0 {
                self.state.look.exposure = Some(drawn.renderer.ev(&self.state.look));
            }
            write_png(&folder.join(format!("frame_{frame:05}.png")), self.size.0, self.size.1, &pixels)?;
        }
        eprintln!("wrote {n_frames} frames into {}", folder.display());
        Ok(())
    }

    fn renderer(&self, gpu: &Gpu) -> Result<Renderer, CommandError> {
        let stage = Stage::new(&self.state, self.bake.bounds, 0.0);
        Renderer::new(gpu, self.bake, &stage.lights, self.size)
    }

    /// What the system beside the file took, if there is one.
    fn frame(&self, drawn: &mut Drawn<'_>, seconds: f32) -> Result<Option<OtherFigures>, CommandError> {
        let Drawn { gpu, renderer, other } = drawn;
        let figures = other.as_mut().map(|other| {
            let Found { light, figures } = other.update(&self.moment(seconds));
            renderer.set_other(gpu, &Arc::new(light));
            figures
        });
        let stage = Stage::new(&self.state, self.bake.bounds, seconds);
        let lines = overlay_lines(self.bake, &self.state, &stage);
        renderer.render(gpu, self.bake, &self.state, &stage, &lines)?;
        match gpu.take_error() {
            Some(error) => Err(too_small(&error)),
            None => Ok(figures),
        }
    }

    fn moment(&self, seconds: f32) -> Moment {
        let stage = Stage::new(&self.state, self.bake.bounds, seconds);
        Moment::of(&self.state, &stage, self.size.0 as f32 / self.size.1 as f32)
    }

    /// What the colors of a map view mean.
    fn describe(&self, renderer: &Renderer) {
        if let Some(legend) = renderer.legend() {
            let Legend { title, low, high, unit, note, .. } = legend;
            let range = if legend.colors.is_empty() { String::new() } else { format!(", {low} to {high} {unit}") };
            eprintln!("{title}{range}; {note}");
        }
    }
}

/// Pixels of a picture unless given: those of the camera.
pub fn picture_size(bake: &OpenBake<'_>, camera: usize) -> (u32, u32) {
    let size = PictureSize::of_camera(&bake.cameras[camera.min(bake.cameras.len() - 1)]);
    (size.width, size.height)
}
