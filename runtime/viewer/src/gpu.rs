//! The device that draws, with or without a window, and what becomes of it.

use localprt_tools::error::{CommandError, Exit};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// An adapter's device and queue.
pub struct Gpu {
    /// What surfaces are made with.
    pub instance: wgpu::Instance,
    /// The adapter.
    pub adapter: wgpu::Adapter,
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    health: Arc<Health>,
}

#[derive(Default)]
struct Health {
    lost: AtomicBool,
    error: Mutex<Option<String>>,
}

impl Gpu {
    /// The fastest adapter, which can show pictures on `surface` if there is one, with all that it offers.
    ///
    /// # Errors
    /// Exit code 5 if there is none, or it gives no device.
    pub async fn new(instance: wgpu::Instance, surface: Option<&wgpu::Surface<'_>>) -> Result<Self, CommandError> {
        let wanted = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: surface,
            ..Default::default()
        };
        let adapter = instance.request_adapter(&wanted).await.map_err(|error| no_gpu(&error))?;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("viewer.device"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = adapter.request_device(&descriptor).await.map_err(|error| no_gpu(&error))?;
        let health = Arc::new(Health::default());
        let seen = Arc::clone(&health);
        device.set_device_lost_callback(move |_, _| seen.lost.store(true, Ordering::Release));
        let seen = Arc::clone(&health);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut first = seen.error.lock().unwrap_or_else(PoisonError::into_inner);
            first.get_or_insert_with(|| error.to_string());
        }));
        Ok(Self { instance, adapter, device, queue, health })
    }

    /// The same without a window.
    ///
    /// # Errors
    /// As [`Gpu::new`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn headless() -> Result<Self, CommandError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        pollster::block_on(Self::new(instance, None))
    }

    /// Whether the device is gone, and everything on it.
    pub fn is_lost(&self) -> bool {
        self.health.lost.load(Ordering::Acquire)
    }

    /// The first error that nobody was asked about since the last call, such as memory that was not there.
    pub fn take_error(&self) -> Option<String> {
        self.health.error.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// One line: what draws, by which interface.
    pub fn name(&self) -> String {
        let info = self.adapter.get_info();
        format!("{} ({:?})", info.name, info.backend)
    }
}

fn no_gpu(error: &dyn std::error::Error) -> CommandError {
    if cfg!(target_arch = "wasm32") {
        // What wgpu says is about backends that pages do not have.
        return CommandError::new(Exit::Unsupported, "this browser gives the page no WebGPU device").help(
            "turn graphics acceleration on in its settings, and start it again if its graphics process has crashed; \
             chrome://gpu or about:support says why",
        );
    }
    CommandError::of(Exit::Unsupported, error).help(
        "the viewer needs a driver for Vulkan, DirectX 12 or Metal; without a GPU, Mesa's lavapipe will do \
         (Debian, Ubuntu: mesa-vulkan-drivers)",
    )
}
