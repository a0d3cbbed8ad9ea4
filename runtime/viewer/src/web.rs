//! In a browser: files that the page has fetched, a WebGPU device, the same viewer.
//!
//! A page calls [`scene_path`] to learn which scene belongs to a baked file, fetches it, and opens the viewer on a canvas
//! with [`run`]. [`picture`] is what `--headless` is elsewhere.

use crate::app::App;
use crate::daylight::{daylight, is_dark};
use crate::frame::Renderer;
use crate::gpu::Gpu;
use crate::open_bake::{Files, OpenBake};
use crate::page::Page;
use crate::stage::Stage;
use crate::state::ViewState;
use crate::window::{self, WindowOptions};
use localprt_formats::Baked;
use localprt_scenes::Lighting;
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
    let options = WindowOptions { screenshot: None, lose_device: None, started, page: Page { canvas, closed } };
    Ok(window::spawn(app, options)?)
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
    let rgba = renderer.target().request_srgb(&gpu.device, &gpu.queue).await?;
    // Browsers are stricter about shaders than other backends, and tell it late: a picture of nothing would be one too.
    match gpu.take_error() {
        Some(error) => Err(JsError::new(&error)),
        None => Ok(rgba),
    }
}
