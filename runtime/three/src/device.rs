//! A WebGPU device that the page's renderer can share.

use wasm_bindgen::prelude::*;

const REMEDY: &str = "turn graphics acceleration on in its settings, and start it again if its graphics process has crashed; \
                      chrome://gpu or about:support says why";

/// A device and its queue.
#[wasm_bindgen]
pub struct Device {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    name: String,
}

#[wasm_bindgen]
impl Device {
    /// An adapter's device with every feature and limit that it offers, so that no renderer misses one.
    ///
    /// # Errors
    /// A browser that gives none.
    pub async fn request(low_power: bool) -> Result<Self, JsError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let power_preference =
            if low_power { wgpu::PowerPreference::LowPower } else { wgpu::PowerPreference::HighPerformance };
        let wanted = wgpu::RequestAdapterOptions { power_preference, ..Default::default() };
        let adapter = instance.request_adapter(&wanted).await.map_err(|_| no_adapter())?;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("localprt.device"),
            required_features: adapter.features(),
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = adapter.request_device(&descriptor).await.map_err(|error| no_device(&error))?;
        Ok(Self { device, queue, name: adapter.get_info().name })
    }

    /// The GPUDevice.
    #[wasm_bindgen(getter)]
    pub fn handle(&self) -> JsValue {
        self.device.as_webgpu().map_or(JsValue::UNDEFINED, |device| device.clone().into())
    }

    /// What the browser calls the adapter; many say nothing.
    #[wasm_bindgen(getter)]
    pub fn name(&self) -> String {
        self.name.clone()
    }
}

/// What wgpu says is about backends that pages do not have; what a browser says of a device it refuses is of use.
fn no_adapter() -> JsError {
    JsError::new(&format!("this browser gives the page no WebGPU adapter: {REMEDY}"))
}

fn no_device(error: &wgpu::RequestDeviceError) -> JsError {
    JsError::new(&format!("this browser gives the page no WebGPU device ({error}): {REMEDY}"))
}
