//! The window: events in, frames out. Everything else is in [`App`] and [`Renderer`].

mod screen;

use crate::app::App;
#[cfg(not(target_arch = "wasm32"))]
use crate::app::Kept;
use crate::frame::Renderer;
use crate::gpu::Gpu;
#[cfg(not(target_arch = "wasm32"))]
use crate::open_bake::{FileStamp, Files, SceneSource, stamp};
use crate::other_system::{Beneath, Found, Moment, News};
use crate::panel::{Figures, History};
use crate::scene_overlays::overlay_lines;
use crate::stage::Stage;
use crate::state::ViewState;
#[cfg(not(target_arch = "wasm32"))]
use localprt_scenes::Sky;
use localprt_tools::error::{CommandError, Exit};
#[cfg(not(target_arch = "wasm32"))]
use localprt_tools::output::{write_file, write_png};
use screen::Screen;
#[cfg(not(target_arch = "wasm32"))]
use std::path::Path;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use web_time::Instant;
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
#[cfg(not(target_arch = "wasm32"))]
use winit::platform::pump_events::{EventLoopExtPumpEvents, PumpStatus};
use winit::window::{Window, WindowId};

/// Frames without a change after which nothing is drawn again: all bounces have arrived.
const STILL_FRAMES: u32 = 64;
/// How long a still window sleeps at most.
const STILL: Duration = Duration::from_millis(500);
/// How long a window sleeps that the system shows nothing of.
const OUT_OF_SIGHT: Duration = Duration::from_millis(100);
/// How often a device that was lost is asked for again before giving up.
const MOST_LOSSES: u32 = 3;

/// How a window begins, and may end.
#[cfg_attr(not(target_arch = "wasm32"), derive(Clone))]
pub struct WindowOptions {
    /// Physical pixels; a page says itself how large its canvas is.
    #[cfg(not(target_arch = "wasm32"))]
    pub size: (u32, u32),
    /// Where the picture goes after so many frames; the window closes then.
    pub screenshot: Option<PathBuf>,
    /// Frames before the screenshot.
    #[cfg(not(target_arch = "wasm32"))]
    pub screenshot_frames: u64,
    /// Frames after which the device is lost, to try how that ends.
    pub lose_device: Option<u64>,
    /// When the program was started.
    pub started: Instant,
    /// Where a page wants it, and what the page hears of it.
    #[cfg(target_arch = "wasm32")]
    pub page: crate::page::Page,
}

/// A window that stays while files come and go.
#[cfg(not(target_arch = "wasm32"))]
pub struct Session {
    event_loop: EventLoop<()>,
    options: WindowOptions,
    /// Left by the file that was shown before.
    window: Option<(wgpu::Instance, Arc<Window>)>,
}

/// A file that has changed, and how the user had the one before.
#[cfg(not(target_arch = "wasm32"))]
pub struct Reloaded {
    /// The file as it is now.
    pub files: Files,
    /// Camera, light, look.
    pub kept: Kept,
}

#[cfg(not(target_arch = "wasm32"))]
impl Session {
    /// Nothing is shown yet.
    ///
    /// # Errors
    /// No display.
    pub fn new(options: WindowOptions) -> Result<Self, CommandError> {
        Ok(Self { event_loop: EventLoop::new().map_err(|error| no_display(&error))?, options, window: None })
    }

    /// Shows a bake until the window is closed, or the file was replaced by another that can be shown: then that is returned, and
    /// the window stays for it. `scene` is what the user named.
    ///
    /// # Errors
    /// No display, no adapter, a device that is too small.
    pub fn show(&mut self, app: App<'_>, scene: &SceneSource) -> Result<Option<Reloaded>, CommandError> {
        let mut host = Host::new(app, self.options.clone());
        host.replaced.scene = scene.clone();
        if let Some((instance, window)) = self.window.take() {
            host.take_over(instance, window)?;
        }
        loop {
            if let PumpStatus::Exit(_) = self.event_loop.pump_app_events(None, &mut host) {
                return host.end.map_or(Ok(None), Err);
            }
            let Some(files) = host.replaced.by.take() else { continue };
            self.options = WindowOptions { started: Instant::now(), lose_device: None, ..host.options };
            if let Some(Shown { gpu, screen, renderer, .. }) = host.shown {
                let window = screen.into_window();
                drop(renderer);
                self.window = Some((gpu.instance, window));
            }
            return Ok(Some(Reloaded { files, kept: host.app.keep() }));
        }
    }
}

/// Looks whether the baked file was replaced.
#[cfg(not(target_arch = "wasm32"))]
struct Replaced {
    /// As the file shown was, or the last one that could not be shown.
    stamp: Option<FileStamp>,
    next_look: Instant,
    scene: SceneSource,
    /// The one that took its place.
    by: Option<Files>,
}

#[cfg(not(target_arch = "wasm32"))]
impl Replaced {
    /// Why another file that is there cannot be shown, once.
    fn look(&mut self, path: &Path) -> Option<CommandError> {
        let now = Instant::now();
        if now < self.next_look {
            return None;
        }
        self.next_look = now + STILL;
        let found = stamp(path);
        // Nothing is there for a moment, where a file is moved in place of another.
        if found.is_none() || found == self.stamp {
            return None;
        }
        self.stamp = found;
        let opened = Files::open(path, self.scene.path.as_deref())
            .and_then(|files| files.in_variant(self.scene.variant.as_deref()))
            .and_then(|files| files.check().map(|()| files));
        match opened {
            Ok(files) => {
                self.by = Some(files);
                None
            }
            Err(error) => Some(error),
        }
    }
}

/// Opens a window in a page, which goes on while the window is open.
///
/// # Errors
/// A page that has no events to give.
#[cfg(target_arch = "wasm32")]
pub fn spawn(app: App<'static>, options: WindowOptions) -> Result<(), CommandError> {
    use winit::platform::web::EventLoopExtWebSys;
    EventLoop::new().map_err(|error| no_display(&error))?.spawn_app(Host::new(app, options));
    Ok(())
}

fn no_display(error: &dyn std::error::Error) -> CommandError {
    CommandError::of(Exit::Unsupported, error)
        .help("a window needs a display; without one use --headless with --screenshot or --record")
}

/// To whoever started the viewer.
fn tell(line: &str) {
    #[cfg(not(target_arch = "wasm32"))]
    eprintln!("{line}");
    #[cfg(target_arch = "wasm32")]
    web_sys::console::log_1(&line.into());
}

/// A running window.
struct Host<'a> {
    app: App<'a>,
    shown: Option<Shown>,
    history: History,
    /// Another system beside the file.
    beneath: Beneath,
    /// Why the window closed, if not by the user.
    end: Option<CommandError>,
    options: WindowOptions,
    n_frames: u64,
    n_losses: u32,
    #[cfg(not(target_arch = "wasm32"))]
    replaced: Replaced,
    /// A device that was asked for and has come.
    #[cfg(target_arch = "wasm32")]
    coming: std::rc::Rc<std::cell::RefCell<Option<Result<Opened, CommandError>>>>,
}

/// A window whose device has come.
type Opened = (Gpu, Arc<Window>, wgpu::Surface<'static>);

/// What needs a device.
struct Shown {
    gpu: Gpu,
    screen: Screen,
    renderer: Renderer,
    last: Last,
}

/// The last frame, to see whether the next one would be another.
struct Last {
    at: Instant,
    picture: Option<(ViewState, Stage)>,
    size: (u32, u32),
    unchanged: u32,
}

impl<'a> Host<'a> {
    fn new(app: App<'a>, options: WindowOptions) -> Self {
        #[cfg(not(target_arch = "wasm32"))]
        let stamp = app.bake.files.stamp;
        Self {
            app,
            shown: None,
            history: History::default(),
            beneath: Beneath::default(),
            end: None,
            options,
            n_frames: 0,
            n_losses: 0,
            #[cfg(not(target_arch = "wasm32"))]
            replaced: Replaced { stamp, next_look: Instant::now(), scene: SceneSource::default(), by: None },
            #[cfg(target_arch = "wasm32")]
            coming: Default::default(),
        }
    }

    fn open(&mut self, event_loop: &ActiveEventLoop) -> Result<(), CommandError> {
        let name = self.app.bake.files.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let attributes = Window::default_attributes().with_title(format!("{name} - localprt viewer"));
        #[cfg(not(target_arch = "wasm32"))]
        let attributes =
            attributes.with_inner_size(winit::dpi::PhysicalSize::new(self.options.size.0, self.options.size.1));
        #[cfg(target_arch = "wasm32")]
        let attributes = {
            use winit::platform::web::WindowAttributesExtWebSys;
            attributes.with_canvas(Some(self.options.page.canvas.clone()))
        };
        let window = Arc::new(event_loop.create_window(attributes).map_err(|error| no_display(&error))?);
        let display = Box::new(event_loop.owned_display_handle());
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle_from_env(display));
        let surface = instance.create_surface(Arc::clone(&window)).map_err(|error| no_display(&error))?;
        self.ask_for_device(instance, window, surface)
    }

    #[cfg(not(target_arch = "wasm32"))]
    fn ask_for_device(
        &mut self,
        instance: wgpu::Instance,
        window: Arc<Window>,
        surface: wgpu::Surface<'static>,
    ) -> Result<(), CommandError> {
        let gpu = pollster::block_on(Gpu::new(instance, Some(&surface)))?;
        self.opened((gpu, window, surface))
    }

    /// Browsers give devices later: see [`Host::coming`].
    #[cfg(target_arch = "wasm32")]
    fn ask_for_device(
        &mut self,
        instance: wgpu::Instance,
        window: Arc<Window>,
        surface: wgpu::Surface<'static>,
    ) -> Result<(), CommandError> {
        let coming = std::rc::Rc::clone(&self.coming);
        wasm_bindgen_futures::spawn_local(async move {
            let gpu = Gpu::new(instance, Some(&surface)).await;
            let asking = Arc::clone(&window);
            *coming.borrow_mut() = Some(gpu.map(|gpu| (gpu, window, surface)));
            asking.request_redraw();
        });
        Ok(())
    }

    fn opened(&mut self, (gpu, window, surface): Opened) -> Result<(), CommandError> {
        let screen = Screen::new(&gpu, window, surface)?;
        let device = gpu.name();
        self.show(gpu, screen)?;
        if self.n_losses == 0 {
            tell(&self.app.bake.summary(&device, self.options.started.elapsed()));
        }
        Ok(())
    }

    fn show(&mut self, gpu: Gpu, screen: Screen) -> Result<(), CommandError> {
        let size = screen.size();
        let lights = self.app.stage().lights;
        let size = (size.0.max(1), size.1.max(1));
        let renderer = Renderer::new(&gpu, self.app.bake, &lights, size)?;
        let last = Last { at: Instant::now(), picture: None, size: (0, 0), unchanged: 0 };
        screen.window().request_redraw();
        self.shown = Some(Shown { gpu, screen, renderer, last });
        Ok(())
    }

    /// Sets everything up again on another device.
    fn recover(&mut self) -> Result<(), CommandError> {
        let Some(shown) = self.shown.take() else { return Ok(()) };
        self.n_losses += 1;
        if self.n_losses > MOST_LOSSES {
            let help = if cfg!(target_arch = "wasm32") {
                "close other pages, start the browser again, and see what chrome://gpu or about:support says"
            } else {
                "see what the driver says; a smaller --size may help"
            };
            return Err(CommandError::new(Exit::Unsupported, "the graphics device was lost again and again").help(help));
        }
        let window = shown.screen.into_window();
        drop(shown.renderer);
        self.app.notice = Some("the graphics device was lost; everything is on a new one".into());
        tell("the graphics device was lost; everything is on a new one");
        self.take_over(shown.gpu.instance, window)
    }

    /// Shows everything in a window that is there.
    fn take_over(&mut self, instance: wgpu::Instance, window: Arc<Window>) -> Result<(), CommandError> {
        let surface = instance.create_surface(Arc::clone(&window)).map_err(|error| no_display(&error))?;
        self.ask_for_device(instance, window, surface)
    }

    fn frame(&mut self, event_loop: &ActiveEventLoop) -> Result<(), CommandError> {
        #[cfg(target_arch = "wasm32")]
        if let Some(opened) = self.coming.take() {
            self.opened(opened?)?;
        }
        if let Some(shown) = &self.shown {
            // Otherwise a loss would be told late. What fails here fails below.
            let _ = shown.gpu.device.poll(wgpu::PollType::Poll);
        }
        if self.shown.as_ref().is_some_and(|shown| shown.gpu.is_lost()) {
            self.recover()?;
        }
        let Some(shown) = &mut self.shown else { return Ok(()) };
        if shown.screen.size().0 == 0 || shown.screen.size().1 == 0 {
            // Minimized: nothing to draw on.
            return Ok(());
        }
        let seconds = shown.last.at.elapsed().as_secs_f32();
        shown.last.at = Instant::now();
        self.app.advance(seconds);
        self.app.ev = shown.renderer.ev(&self.app.state.look);
        let is_still = shown.last.unchanged >= STILL_FRAMES && shown.renderer.is_metered(&self.app.state.look);
        let memory = shown.renderer.memory();
        let figures = Figures {
            device: &shown.gpu.name(),
            history: &self.history,
            memory: &memory,
            gathers: shown.renderer.gathers(),
            size: shown.renderer.target().size(),
            legend: shown.renderer.legend(),
            is_still,
        };
        let app = &mut self.app;
        let (rect, painted) = shown.screen.run_ui(|ui| app.ui(ui, &figures));
        let scaled = |side: u32| ((side as f32 * app.render_scale).round() as u32).max(1);
        let size = (scaled(rect.width), scaled(rect.height));
        match shown.draw(app, &mut self.beneath, size) {
            // A state that cannot be shown is not worth the user's other work; the last picture stays.
            Err(error) if error.exit == Exit::InvalidInput => app.notice = Some(error.what),
            drawn => drawn?,
        }
        shown.screen.present(&shown.gpu, shown.renderer.target(), rect, painted)?;
        if let Some(error) = shown.gpu.take_error().filter(|_| !shown.gpu.is_lost()) {
            return Err(CommandError::new(Exit::Unsupported, format!("the graphics device gave up: {error}"))
                .help("close other programs that use it, or make the window smaller"));
        }
        if !is_still {
            self.history.push(1e3 * seconds, shown.renderer.times());
        }
        self.n_frames += 1;
        #[cfg(target_arch = "wasm32")]
        self.options.page.frame(self.n_frames, shown.renderer.gathers(), is_still, app);
        if self.options.lose_device == Some(self.n_frames) {
            shown.gpu.device.destroy();
        }
        self.finish_requests(event_loop)
    }

    fn redraw(&mut self, event_loop: &ActiveEventLoop) {
        let Err(error) = self.frame(event_loop) else { return };
        // A loss is noticed by the calls that fail for it; the next frame starts over.
        if self.shown.as_ref().is_some_and(|shown| shown.gpu.is_lost()) {
            return;
        }
        self.end = Some(error);
        event_loop.exit();
    }

    fn finish_requests(&mut self, event_loop: &ActiveEventLoop) -> Result<(), CommandError> {
        let Some(shown) = &mut self.shown else { return Ok(()) };
        let requests = std::mem::take(&mut self.app.requests);
        if requests.reset {
            shown.renderer.reset();
            shown.last.unchanged = 0;
        }
        if requests.meter {
            shown.renderer.meter_again();
            shown.last.unchanged = 0;
        }
        #[cfg(target_arch = "wasm32")]
        if requests.save_picture || requests.save_lighting {
            self.app.notice = Some("pages write no files; the viewer without a browser does".into());
        }
        #[cfg(not(target_arch = "wasm32"))]
        if requests.save_picture {
            let written = free_name("viewer", "png").and_then(|path| shown.save(&self.app, &path).map(|()| path));
            self.app.notice = Some(told(written));
        }
        #[cfg(not(target_arch = "wasm32"))]
        if requests.save_lighting {
            let written = free_name("lighting", "json").and_then(|path| save_lighting(&self.app, &path).map(|()| path));
            let is_picture = matches!(*self.app.state.sky, Sky::Equirect { .. });
            let without_sky = if is_picture { "; its sky is a picture, and was left out" } else { "" };
            self.app.notice = Some(told(written) + without_sky);
        }
        #[cfg(not(target_arch = "wasm32"))]
        if self.n_frames >= self.options.screenshot_frames
            && let Some(path) = &self.options.screenshot
        {
            // From a device that is lost there is no picture; the next one has it.
            shown.save(&self.app, path)?;
            self.options.screenshot = None;
            event_loop.exit();
        }
        if requests.quit {
            event_loop.exit();
        }
        Ok(())
    }
}

impl Shown {
    /// Whether the next picture would be the last one again.
    fn rests(&self, state: &ViewState) -> bool {
        self.last.unchanged > STILL_FRAMES && self.renderer.is_metered(&state.look)
    }

    /// The picture, unless it would be the last one again.
    fn draw(&mut self, app: &mut App<'_>, beneath: &mut Beneath, size: (u32, u32)) -> Result<(), CommandError> {
        let stage = app.stage();
        let is_same = self.last.size == size
            && self.last.picture.as_ref().is_some_and(|(state, last)| *last == stage && state.is_same_as(&app.state));
        self.last.unchanged = if is_same { self.last.unchanged.saturating_add(1) } else { 0 };
        let moment = || Moment::of(&app.state, &stage, size.0 as f32 / size.1 as f32);
        match beneath.follow(app.bake, app.state.beside, !is_same, moment) {
            News::Nothing => {}
            News::Gone => app.other = None,
            News::Found(Found { light, figures }) => {
                app.other = Some((Arc::new(light), figures));
                // Once more, with what has come.
                self.last.unchanged = self.last.unchanged.min(STILL_FRAMES);
            }
        }
        if let Some((light, _)) = &app.other {
            self.renderer.set_other(&self.gpu, light);
        }
        if self.rests(&app.state) {
            return Ok(());
        }
        if !is_same {
            self.last.picture = Some((app.state.clone(), stage.clone()));
            self.last.size = size;
        }
        self.renderer.resize(&self.gpu, size);
        let lines = overlay_lines(app.bake, &app.state, &stage);
        self.renderer.render(&self.gpu, app.bake, &app.state, &stage, &lines)
    }

    #[cfg(not(target_arch = "wasm32"))]
    fn save(&mut self, app: &App<'_>, path: &Path) -> Result<(), CommandError> {
        let (width, height) = self.renderer.target().size();
        let pixels = self.renderer.read_picture(&self.gpu, app.bake, &app.state)?;
        Ok(write_png(path, width, height, &pixels)?)
    }
}

#[cfg(not(target_arch = "wasm32"))]
fn save_lighting(app: &App<'_>, path: &Path) -> Result<(), CommandError> {
    let mut text = format!("{:#}", app.state.lighting(app.stage().lights).to_json());
    text.push('\n');
    Ok(write_file(path, text.as_bytes())?)
}

#[cfg(not(target_arch = "wasm32"))]
fn told(written: Result<PathBuf, CommandError>) -> String {
    match written {
        Ok(path) => format!("wrote {}", path.display()),
        Err(error) => error.to_string(),
    }
}

/// A name in this folder that nothing has yet.
#[cfg(not(target_arch = "wasm32"))]
fn free_name(stem: &str, extension: &str) -> Result<PathBuf, CommandError> {
    let name = |number: u32| PathBuf::from(format!("{stem}-{number:03}.{extension}"));
    (1..1000).map(name).find(|path| !path.exists()).ok_or_else(|| {
        CommandError::new(Exit::Io, format!("there are a thousand {stem} files here already"))
            .help("start the viewer in another folder")
    })
}

impl ApplicationHandler for Host<'_> {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.shown.is_none()
            && let Err(error) = self.open(event_loop)
        {
            self.end = Some(error);
            event_loop.exit();
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if matches!(event, WindowEvent::RedrawRequested) {
            self.redraw(event_loop);
            return;
        }
        let Some(shown) = &mut self.shown else { return };
        if shown.screen.on_event(&event) {
            // Something to react to; a still picture goes on being one unless the state changes.
            shown.screen.window().request_redraw();
        }
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::Resized(size) => {
                shown.screen.resize(&shown.gpu, size.width, size.height);
                shown.screen.window().request_redraw();
            }
            _ => {}
        }
    }

    #[cfg(target_arch = "wasm32")]
    fn exiting(&mut self, _: &ActiveEventLoop) {
        self.options.page.closed(self.end.take());
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        #[cfg(not(target_arch = "wasm32"))]
        if let Some(error) = self.replaced.look(&self.app.bake.files.path) {
            tell(&format!("the file has changed, and the one before stays: {error}"));
            self.app.notice = Some(format!("the file has changed, and the one before stays: {}", error.what));
        }
        if cfg!(target_arch = "wasm32") && self.shown.as_ref().is_some_and(|shown| shown.gpu.is_lost()) {
            // A browser whose graphics process has ended too often asks for no frame any more.
            return self.redraw(event_loop);
        }
        let Some(shown) = &self.shown else { return };
        let is_hidden = shown.screen.size().0 == 0 || shown.screen.size().1 == 0;
        if is_hidden {
            event_loop.set_control_flow(ControlFlow::Wait);
        } else if shown.screen.is_out_of_sight() {
            event_loop.set_control_flow(ControlFlow::WaitUntil(Instant::now() + OUT_OF_SIGHT));
            shown.screen.window().request_redraw();
        } else if shown.rests(&self.app.state) && self.options.screenshot.is_none() {
            // Looks after the device now and then, so that a loss does not wait for the user.
            let _ = shown.gpu.device.poll(wgpu::PollType::Poll);
            let now = Instant::now();
            let repaint_at = shown.screen.repaint_at();
            if shown.gpu.is_lost() || repaint_at.is_some_and(|at| at <= now) {
                shown.screen.window().request_redraw();
            }
            let next = now + if self.beneath.is_there() { OUT_OF_SIGHT } else { STILL };
            if self.beneath.is_there() {
                shown.screen.window().request_redraw();
            }
            event_loop.set_control_flow(ControlFlow::WaitUntil(repaint_at.map_or(next, |at| at.clamp(now, next))));
        } else {
            // In a page, the next frame comes when the browser wants one; asking without pause would stop all else there.
            let flow = if cfg!(target_arch = "wasm32") {
                ControlFlow::WaitUntil(Instant::now() + STILL)
            } else {
                ControlFlow::Poll
            };
            event_loop.set_control_flow(flow);
            shown.screen.window().request_redraw();
        }
    }
}
