//! Somebody else's renderer in a window, lit by the relighter: device, vertices, shader and frames are its own.
//!
//! Usage: `cargo run --release --example host_window -- FILE.lprt SCENE.glb [--frames N]`. The scene is the one with lightmap
//! coordinates that the bake wrote beside the file, or the one that was baked if it brought its own. Its first light goes
//! around in a circle. The window closes after N frames.

mod draw;

use draw::{Draw, depth_buffer};
use glam::{Mat4, Vec3, camera::rh::proj::directx::perspective_infinite_reverse};
use localprt_formats::Baked;
use localprt_runtime::{DirectLight, DirectOptions, Relighter, RelighterOptions};
use localprt_scenes::{Light, Lighting, Scene};
use std::sync::Arc;
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::window::{Window, WindowId};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (file, scene, last_frame) = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [file, scene] => (file, scene, None),
        [file, scene, "--frames", n_frames] => (file, scene, Some(n_frames.parse()?)),
        _ => return Err("usage: host_window FILE.lprt SCENE.glb [--frames N]".into()),
    };
    let (baked, scene) = (Baked::open(file)?, localprt_scenes::load(scene)?);
    let mut host = Host { baked, scene, last_frame, renderer: None, end: Ok(()) };
    EventLoop::new()?.run_app(&mut host)?;
    host.end
}

struct Host {
    baked: Baked,
    scene: Scene,
    last_frame: Option<u64>,
    renderer: Option<Renderer>,
    end: Result<(), Failure>,
}

impl ApplicationHandler for Host {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.renderer.is_none() {
            match Renderer::new(event_loop, &self.baked, &self.scene) {
                Ok(renderer) => self.renderer = Some(renderer),
                Err(failure) => self.fail(event_loop, failure),
            }
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(renderer) = &mut self.renderer else { return };
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::Resized(_) => renderer.configure(),
            WindowEvent::RedrawRequested => match renderer.frame() {
                Ok(()) if self.last_frame.is_some_and(|last| renderer.n_frames >= last) => event_loop.exit(),
                Ok(()) => renderer.window.request_redraw(),
                Err(failure) => self.fail(event_loop, failure),
            },
            _ => {}
        }
    }
}

impl Host {
    fn fail(&mut self, event_loop: &ActiveEventLoop, failure: Failure) {
        self.end = Err(failure);
        event_loop.exit();
    }
}

struct Renderer {
    relighter: Relighter,
    lights: Vec<Light>,
    /// Of the scene's box, metres.
    extent_m: f32,
    camera_to_world: Mat4,
    fov_y: f32,
    draw: Draw,
    depth: wgpu::TextureView,
    config: wgpu::SurfaceConfiguration,
    surface: wgpu::Surface<'static>,
    window: Arc<Window>,
    device: wgpu::Device,
    queue: wgpu::Queue,
    n_frames: u64,
}

impl Renderer {
    fn new(event_loop: &ActiveEventLoop, baked: &Baked, scene: &Scene) -> Result<Self, Failure> {
        // The host's own device: the relighter needs no feature, and no more than the limits that WebGPU guarantees.
        let window = Arc::new(event_loop.create_window(Window::default_attributes().with_title("host_window"))?);
        let display = Box::new(event_loop.owned_display_handle());
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle(display));
        let surface = instance.create_surface(Arc::clone(&window))?;
        let wanted = wgpu::RequestAdapterOptions { compatible_surface: Some(&surface), ..Default::default() };
        let adapter = pollster::block_on(instance.request_adapter(&wanted))?;
        let (device, queue) = pollster::block_on(adapter.request_device(&Default::default()))?;
        let mut config = surface.get_default_config(&adapter, 1, 1).ok_or("the device cannot draw on this window")?;
        let formats = surface.get_capabilities(&adapter).formats;
        config.format = formats.into_iter().find(wgpu::TextureFormat::is_srgb).ok_or("the window takes no sRGB")?;

        // The relighter: file and scene once. With six layers per light all shadow maps are there at once, for the host to read.
        let lighting = Lighting::of_scene(scene);
        let direct = DirectOptions { shadow_map_size: 1024, shadow_layers: 6 * lighting.lights.len().max(1) as u32 };
        let checked = baked.checked()?;
        let options = RelighterOptions { direct, ..Default::default() };
        let mut relighter = Relighter::new(&device, &queue, &checked, options)?;
        relighter.set_scene(scene, &checked)?;
        relighter.set_lighting(&lighting)?;

        // What the host draws, and how.
        let light_layout = relighter.direct_pass().ok_or("no scene")?.light_layout();
        let draw = Draw::new(&device, &relighter, light_layout, scene, config.format);
        let (low, high) = scene.bounds().ok_or("the scene is empty")?;
        let in_front = (Mat4::from_translation(0.5 * (low + high) + Vec3::Z * scene.extent()), 0.8);
        let (camera_to_world, fov_y) = scene.cameras.first().map_or(in_front, |camera| (camera.to_world, camera.fov_y));
        let mut renderer = Self {
            relighter,
            lights: lighting.lights,
            extent_m: scene.extent(),
            camera_to_world,
            fov_y,
            draw,
            depth: depth_buffer(&device, 1, 1),
            config,
            surface,
            window,
            device,
            queue,
            n_frames: 0,
        };
        renderer.configure();
        renderer.window.request_redraw();
        Ok(renderer)
    }

    /// Fits everything to the window.
    fn configure(&mut self) {
        let size = self.window.inner_size();
        (self.config.width, self.config.height) = (size.width.max(1), size.height.max(1));
        self.surface.configure(&self.device, &self.config);
        self.depth = depth_buffer(&self.device, self.config.width, self.config.height);
        let aspect = self.config.width as f32 / self.config.height as f32;
        let projection = perspective_infinite_reverse(self.fov_y, aspect, 5e-4 * self.extent_m);
        let world_to_clip = projection * self.camera_to_world.inverse();
        self.draw.set_camera(&self.queue, &world_to_clip);
    }

    fn frame(&mut self) -> Result<(), Failure> {
        use wgpu::CurrentSurfaceTexture as Current;
        let picture = match self.surface.get_current_texture() {
            Current::Success(picture) | Current::Suboptimal(picture) => picture,
            Current::Outdated => {
                self.configure();
                return Ok(());
            }
            Current::Timeout | Current::Occluded => return Ok(()),
            Current::Lost | Current::Validation => return Err("the window's surface is lost".into()),
        };
        // Whatever has changed is set before the frame is recorded; here the lights alone. The circle goes by frames instead of
        // seconds, so that as many of them end in the same picture anywhere.
        let (sin, cos) = (0.05 * self.n_frames as f32).sin_cos();
        let mut lights = self.lights.clone();
        if let Some(light) = lights.first_mut() {
            let away = 0.1 * Vec3::new(cos, 0.0, sin);
            light.position += self.extent_m * away;
            light.direction = (light.direction + away).normalize();
        }
        self.relighter.set_lights(&lights);

        // One encoder: the relighter's passes, then the host's, which samples what they wrote.
        let mut encoder = self.device.create_command_encoder(&Default::default());
        self.relighter.encode(&mut encoder, &DirectLight::Lights)?;
        let light_group = self.relighter.direct_pass().and_then(|pass| pass.light_group());
        let light_group = light_group.ok_or("more lights than a texture array has layers for")?;
        let view = picture.texture.create_view(&Default::default());
        self.draw.encode(&mut encoder, light_group, &view, &self.depth);
        self.queue.submit([encoder.finish()]);
        self.window.pre_present_notify();
        self.queue.present(picture);
        self.n_frames += 1;
        Ok(())
    }
}
