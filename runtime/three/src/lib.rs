//! The relighter for pages that draw with three.js: a device, a baked file with its scene, lights in, a texture out.
//!
//! `localprt.js` is what pages import; it turns objects of three.js into the numbers that are taken here. World space, metres, +Y up,
//! linear Rec. 709, candela and lux, radiance in W sr^-1 m^-2: three.js and glTF mean the same.

mod device;
mod lights;
mod relight;

use localprt_formats::Baked;
use wasm_bindgen::prelude::*;

/// Where the scene of a baked file is, relative to the file.
///
/// # Errors
/// Bytes that are no baked file.
#[wasm_bindgen(js_name = scenePath)]
pub fn scene_path(file: Vec<u8>) -> Result<String, JsError> {
    Ok(Baked::from_bytes(file)?.metadata().scene_path.clone())
}

/// The largest that this module's memory has been, bytes: it does not shrink.
#[wasm_bindgen(js_name = memoryBytes)]
pub fn memory_bytes() -> f64 {
    let memory: js_sys::WebAssembly::Memory = wasm_bindgen::memory().unchecked_into();
    let buffer: js_sys::ArrayBuffer = memory.buffer().unchecked_into();
    f64::from(buffer.byte_length())
}
