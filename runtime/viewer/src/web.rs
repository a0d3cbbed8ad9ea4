//! In a browser: files that the page has fetched, a WebGPU device, the same viewer.
//!
//! A page calls [`scene_path`] to learn which scene belongs to a baked file, fetches it, and opens the viewer on a canvas
//! with [`run`]. [`picture`] is what `--headless` is elsewhere.

use crate::app::App;
use crate::daylight::{daylight, is_dark};
use crate::frame::Renderer;
use crate::gpu::Gpu;
use crate::open_bake::{Files, OpenBake};
use crate::stage::Stage;
use crate::state::ViewState;
use crate::window::{self, WindowOptions};
use localprt_formats::Baked;
use localprt_scenes::Lighting;
use localprt_tools::error::CommandError;
use std::cell::RefCell;
use wasm_bindgen::prelude::*;
use web_time::Instant;

/// Panics are told on the console; without this they are `unreachable executed`.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| web_sys::console::error_1(&panic.to_string().into())));
}

/// Where the scene of a baked file is, relative to the file.
#[wasm_bindgen(js_name = scenePath)]
pub fn scene_path(file: Vec<u8>) -> Result<String, JsError> {
    Ok(Baked::from_bytes(file)?.view().metadata.scene_path.clone())
}

/// Opens the viewer on a canvas, and returns; it stays for as long as the page does, or until `closed` is called: with a
/// message, or without one if the user has closed it.
#[wasm_bindgen]
pub fn run(
    canvas: web_sys::HtmlCanvasElement,
    name: String,
    file: Vec<u8>,
    scene_name: String,
    scene: Vec<u8>,
    closed: js_sys::Function,
) -> Result<(), JsError> {
    let started = Instant::now();
    // As long as the page.
    let files: &'static Files = Box::leak(Box::new(Files::from_memory(&name, file, &scene_name, &scene)?));
    let bake: &'static OpenBake<'static> = Box::leak(Box::new(OpenBake::new(files)?));
    let mut lighting = Lighting::of_scene(&files.scene);
    if is_dark(&files.scene, &lighting) {
        lighting = daylight();
    }
    let app = App::new(bake, ViewState::new(bake, 0, &lighting), 0, lighting);
    let options = WindowOptions {
        size: (canvas.width(), canvas.height()),
        screenshot: None,
        screenshot_frames: 0,
        lose_device: None,
        started,
        page: Page { canvas, closed },
    };
    Ok(window::spawn(app, options)?)
}

/// What the last frame of the viewer was made of, as JSON; empty before the first one. For tests of pages.
#[wasm_bindgen(js_name = lastFrame)]
pub fn last_frame() -> String {
    LAST_FRAME.with_borrow(|frame| frame.as_ref().map(ToString::to_string).unwrap_or_default())
}

thread_local! {
    static LAST_FRAME: RefCell<Option<serde_json::Value>> = const { RefCell::new(None) };
}

/// Where the viewer is, and who hears of it.
pub(crate) struct Page {
    pub(crate) canvas: web_sys::HtmlCanvasElement,
    closed: js_sys::Function,
}

impl Page {
    /// A frame has been shown.
    pub(crate) fn frame(&self, n_frames: u64, n_gathers: u64, is_still: bool, app: &App<'_>) {
        let viewpoint = &app.state.viewpoint;
        LAST_FRAME.set(Some(serde_json::json!({
            "frames": n_frames,
            "gathers": n_gathers,
            "still": is_still,
            "eye": viewpoint.eye().to_array(),
            "ahead": viewpoint.ahead().to_array(),
            "view": format!("{:?}", app.state.look.view),
            "exposure": app.ev,
            "notice": app.notice,
        })));
    }

    /// There will be no more frames.
    pub(crate) fn closed(&self, error: Option<CommandError>) {
        let message = error.map_or(JsValue::UNDEFINED, |error| error.to_string().into());
        // A page that fails at this has been told.
        let _ = self.closed.call1(&JsValue::NULL, &message);
    }
}

/// A picture of a baked scene under its own lights after `frames` gathers: `width * height` times RGBA, sRGB, top row first.
#[wasm_bindgen]
pub async fn picture(
    file: Vec<u8>,
    scene_name: String,
    scene: Vec<u8>,
    width: u32,
    height: u32,
    frames: u32,
    exposure: f32,
) -> Result<Vec<u8>, JsError> {
    let files = Files::from_memory("the baked file", file, &scene_name, &scene)?;
    let bake = OpenBake::new(&files)?;
    let mut state = ViewState::new(&bake, 0, &Lighting::of_scene(&files.scene));
    state.look.exposure = Some(exposure);
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let gpu = Gpu::new(instance, None).await?;
    let stage = Stage::new(&state, bake.bounds, 0.0);
    let mut renderer = Renderer::new(&gpu, &bake, &stage.lights, (width, height))?;
    for _ in 0..frames.max(1) {
        renderer.render(&gpu, &bake, &state, &stage, &[])?;
    }
    Ok(renderer.target().request_srgb(&gpu.device, &gpu.queue).await?)
}
