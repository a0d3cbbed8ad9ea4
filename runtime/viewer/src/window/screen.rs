//! A window's surface with the picture and, over it, what egui paints.

use crate::blit::{Blit, PixelRect};
use crate::gpu::Gpu;
use crate::target::OffscreenTarget;
use localprt_tools::error::{CommandError, Exit};
use std::sync::Arc;
use web_time::Instant;
use winit::event::WindowEvent;
use winit::window::Window;

/// Formats that hold what is encoded already; the device says which it prefers.
const FORMATS: [wgpu::TextureFormat; 3] =
    [wgpu::TextureFormat::Bgra8Unorm, wgpu::TextureFormat::Rgba8Unorm, wgpu::TextureFormat::Rgb10a2Unorm];

/// A surface, its size, and egui's state for its window.
pub struct Screen {
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    blit: Blit,
    egui: egui::Context,
    egui_state: egui_winit::State,
    egui_renderer: egui_wgpu::Renderer,
    repaint_at: Option<Instant>,
    is_out_of_sight: bool,
    // Outlives the surface.
    window: Arc<Window>,
    size: (u32, u32),
}

/// What egui wants painted.
pub struct Painted {
    jobs: Vec<egui::ClippedPrimitive>,
    textures: egui::TexturesDelta,
    pixels_per_point: f32,
}

impl Screen {
    /// Readies a window's surface.
    ///
    /// # Errors
    /// A surface that this device cannot draw on.
    pub fn new(gpu: &Gpu, window: Arc<Window>, surface: wgpu::Surface<'static>) -> Result<Self, CommandError> {
        let size = window.inner_size();
        let capabilities = surface.get_capabilities(&gpu.adapter);
        // Both picture and egui come encoded.
        let format = capabilities.formats.iter().copied().find(|format| FORMATS.contains(format));
        let config = surface.get_default_config(&gpu.adapter, size.width.max(1), size.height.max(1));
        let (Some(format), Some(mut config)) = (format, config) else {
            let help = "choose another driver, or use --headless";
            return Err(CommandError::new(Exit::Unsupported, "the device cannot draw on this window").help(help));
        };
        config.format = format;
        config.present_mode = wgpu::PresentMode::AutoVsync;
        surface.configure(&gpu.device, &config);
        let egui = egui::Context::default();
        let egui_state = egui_winit::State::new(
            egui.clone(),
            egui::ViewportId::ROOT,
            &*window,
            Some(window.scale_factor() as f32),
            window.theme(),
            Some(gpu.device.limits().max_texture_dimension_2d as usize),
        );
        egui.set_theme(egui::Theme::Dark);
        Ok(Self {
            blit: Blit::new(&gpu.device, format),
            egui_renderer: egui_wgpu::Renderer::new(&gpu.device, format, egui_wgpu::RendererOptions::default()),
            egui,
            egui_state,
            surface,
            config,
            repaint_at: None,
            is_out_of_sight: false,
            size: (size.width, size.height),
            window,
        })
    }

    /// The window.
    pub fn window(&self) -> &Window {
        &self.window
    }

    /// The window without its surface.
    pub fn into_window(self) -> Arc<Window> {
        self.window
    }

    /// Physical pixels; a side of 0 while minimized.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// When egui wants to be painted again, if nothing happens before.
    pub fn repaint_at(&self) -> Option<Instant> {
        self.repaint_at
    }

    /// Whether the system showed nothing of the last frame.
    pub fn is_out_of_sight(&self) -> bool {
        self.is_out_of_sight
    }

    /// Takes another size; one without pixels is remembered, and nothing is drawn.
    pub fn resize(&mut self, gpu: &Gpu, width: u32, height: u32) {
        self.size = (width, height);
        let largest = gpu.device.limits().max_texture_dimension_2d;
        if width > 0 && height > 0 {
            (self.config.width, self.config.height) = (width.min(largest), height.min(largest));
            self.surface.configure(&gpu.device, &self.config);
        }
    }

    /// Tells egui of an event; whether it wants to be painted again.
    pub fn on_event(&mut self, event: &WindowEvent) -> bool {
        self.egui_state.on_window_event(&self.window, event).repaint
    }

    /// Runs egui, and returns what its program returned with what is to be painted.
    pub fn run_ui<R: Default>(&mut self, mut program: impl FnMut(&mut egui::Ui) -> R) -> (R, Painted) {
        let input = self.egui_state.take_egui_input(&self.window);
        let mut result = R::default();
        let output = self.egui.run_ui(input, |ui| result = program(ui));
        self.egui_state.handle_platform_output(&self.window, output.platform_output);
        let viewport = output.viewport_output.get(&egui::ViewportId::ROOT);
        self.repaint_at = viewport.and_then(|viewport| Instant::now().checked_add(viewport.repaint_delay));
        let painted = Painted {
            jobs: self.egui.tessellate(output.shapes, output.pixels_per_point),
            textures: output.textures_delta,
            pixels_per_point: output.pixels_per_point,
        };
        (result, painted)
    }

    /// Shows a picture in a part of the window, and egui over it. A frame that the system does not take is left out.
    ///
    /// # Errors
    /// A surface that stays unusable.
    pub fn present(
        &mut self,
        gpu: &Gpu,
        picture: &OffscreenTarget,
        rect: PixelRect,
        painted: Painted,
    ) -> Result<(), CommandError> {
        use wgpu::CurrentSurfaceTexture as Current;
        let (device, queue) = (&gpu.device, &gpu.queue);
        for (id, deltas) in &painted.textures.set {
            for delta in deltas {
                self.egui_renderer.update_texture(device, queue, *id, delta);
            }
        }
        let current = self.surface.get_current_texture();
        self.is_out_of_sight = matches!(current, Current::Timeout | Current::Occluded);
        let (frame, is_stale) = match current {
            Current::Success(frame) => (Some(frame), false),
            Current::Suboptimal(frame) => (Some(frame), true),
            Current::Timeout | Current::Occluded | Current::Validation => (None, false),
            Current::Outdated => (None, true),
            Current::Lost => {
                self.surface = gpu
                    .instance
                    .create_surface(Arc::clone(&self.window))
                    .map_err(|error| CommandError::of(Exit::Unsupported, &error).help("open the viewer again"))?;
                (None, true)
            }
        };
        let was_shown = frame.is_some();
        if let Some(frame) = frame {
            self.paint(gpu, &frame, picture, rect, &painted);
            self.window.pre_present_notify();
            queue.present(frame);
        }
        if is_stale {
            self.surface.configure(device, &self.config);
        }
        if !was_shown {
            // A still picture is not drawn again by itself.
            self.window.request_redraw();
        }
        for id in &painted.textures.free {
            self.egui_renderer.free_texture(id);
        }
        Ok(())
    }

    fn paint(
        &mut self,
        gpu: &Gpu,
        frame: &wgpu::SurfaceTexture,
        picture: &OffscreenTarget,
        rect: PixelRect,
        painted: &Painted,
    ) {
        let (device, queue) = (&gpu.device, &gpu.queue);
        let screen = egui_wgpu::ScreenDescriptor {
            size_in_pixels: [self.config.width, self.config.height],
            pixels_per_point: painted.pixels_per_point,
        };
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut commands = self.egui_renderer.update_buffers(device, queue, &mut encoder, &painted.jobs, &screen);
        let view = frame.texture.create_view(&Default::default());
        let mut pass = encoder
            .begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("viewer.screen"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            })
            .forget_lifetime();
        // The window may have become smaller since egui laid the picture out.
        let rect = PixelRect {
            width: rect.width.min(self.config.width.saturating_sub(rect.x)),
            height: rect.height.min(self.config.height.saturating_sub(rect.y)),
            ..rect
        };
        self.blit.draw(device, &mut pass, &picture.srgb_bytes_view(), picture.size(), rect);
        pass.set_viewport(0.0, 0.0, self.config.width as f32, self.config.height as f32, 0.0, 1.0);
        self.egui_renderer.render(&mut pass, &painted.jobs, &screen);
        drop(pass);
        commands.push(encoder.finish());
        queue.submit(commands);
    }
}
