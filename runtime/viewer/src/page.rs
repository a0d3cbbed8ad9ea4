//! The page that the viewer is part of, in a browser.

use crate::app::App;
use localprt_tools::error::CommandError;
use std::cell::RefCell;
use wasm_bindgen::prelude::*;

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
    pub(crate) closed: js_sys::Function,
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
