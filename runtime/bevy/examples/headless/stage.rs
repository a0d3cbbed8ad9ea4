//! A Bevy app without a window: the baked scene, its camera and lamp, frame by frame.

use bevy::asset::RenderAssetUsages;
use bevy::camera::{Exposure, RenderTarget};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::{DirectionalLightShadowMap, PointLightShadowMap};
use bevy::prelude::*;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy::render::{RenderApp, RenderPlugin};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_localprt::{LocalprtPlugin, Relit, RelitMaps, RelitStatus};
use std::path::Path;
use std::time::{Duration, Instant};

/// Radiance times so much is what the picture shows, as with `--exposure 2` of the viewer.
pub const EXPOSURE: f32 = 4.0;
/// For loading and the first frame.
const PATIENCE: Duration = Duration::from_secs(300);

pub struct Stage {
    pub app: App,
    pub root: Entity,
    pub camera: Entity,
    pub lamp: Entity,
    pub file: String,
    target: Handle<Image>,
}

impl Stage {
    /// Loads a file with its scene and draws until both are there.
    pub fn new(file: &Path, [width, height]: [u32; 2]) -> Result<Self, String> {
        let path = std::path::absolute(file).map_err(|error| error.to_string())?;
        let (Some(folder), Some(name)) = (path.parent(), file.file_name()) else {
            return Err(format!("{} is no file", file.display()));
        };
        let name = name.to_string_lossy().into_owned();
        let mut app = app(folder);
        let target = app.world_mut().resource_mut::<Assets<Image>>().add(target_image(width, height));
        let nobody = Entity::PLACEHOLDER;
        let mut stage = Self { app, root: nobody, camera: nobody, lamp: nobody, file: name, target };
        stage.enter()?;
        Ok(stage)
    }

    /// Spawns the scene, and draws until its light is there.
    pub fn enter(&mut self) -> Result<(), String> {
        let stage = self;
        let assets = stage.app.world().resource::<AssetServer>();
        let scene = assets.load(format!("{}#Scene0", stage.file.replace(".lprt", ".glb")));
        let relit = Relit::new(assets.load(&stage.file));
        stage.root = stage.app.world_mut().spawn((WorldAssetRoot(scene), relit)).id();
        stage.await_light()?;
        // Light and scene come each by itself.
        for _ in 0..1000 {
            if stage.count::<Camera3d>() > 0 {
                break;
            }
            std::thread::sleep(Duration::from_millis(2));
            stage.app.update();
        }
        stage.camera = stage.only::<Camera3d>()?;
        stage.lamp = stage.only::<PointLight>()?;
        let exposure = Exposure { ev100: -(EXPOSURE * 1.2).log2() };
        let target = RenderTarget::Image(stage.target.clone().into());
        stage.app.world_mut().entity_mut(stage.camera).insert((target, exposure, Tonemapping::None));
        // Bevy looks at a camera's new target when its projection changes.
        stage.change::<Projection>(stage.camera, |_| ());
        // The lamp's shadows are as sharp as two metres need.
        stage.change::<PointLight>(stage.lamp, |light| {
            light.shadow_maps_enabled = true;
            light.shadow_depth_bias = 0.01;
            light.shadow_map_near_z = 0.01;
        });
        Ok(())
    }

    /// Draws frames until the relighter has made a first gather.
    pub fn await_light(&mut self) -> Result<(), String> {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            self.app.update();
            let status = self.status();
            if let Some(error) = status.error {
                return Err(error);
            }
            if status.gathers > 0 {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        Err(format!("no light within {} s", PATIENCE.as_secs()))
    }

    /// So many frames from darkness, one gather each.
    pub fn draw_anew(&mut self, n_frames: u32) -> Result<(), String> {
        self.change::<Relit>(self.root, |relit| relit.reset += 1);
        for _ in 0..n_frames {
            self.app.update();
        }
        let gathers = self.status().gathers;
        if gathers == u64::from(n_frames) { Ok(()) } else { Err(format!("{gathers} gathers in {n_frames} frames")) }
    }

    pub fn status(&self) -> RelitStatus {
        self.app.world().get::<RelitMaps>(self.root).map(RelitMaps::status).unwrap_or_default()
    }

    pub fn change<C: Component<Mutability = bevy::ecs::component::Mutable>>(
        &mut self,
        entity: Entity,
        change: impl FnOnce(&mut C),
    ) {
        let mut component = self.app.world_mut().get_mut::<C>(entity).expect("this entity has this component");
        change(&mut component);
    }

    /// All materials that the scene calls so; all of them for "".
    pub fn change_materials(&mut self, name: &str, change: impl Fn(&mut StandardMaterial)) {
        let world = self.app.world_mut();
        let mut worn = world.query::<(&bevy::gltf::GltfMaterialName, &MeshMaterial3d<StandardMaterial>)>();
        let named = worn.iter(world).filter(|(known, _)| name.is_empty() || known.0 == name);
        let ids: Vec<_> = named.map(|(_, material)| material.id()).collect();
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        for id in ids {
            if let Some(mut material) = materials.get_mut(id) {
                change(&mut material);
            }
        }
    }

    pub fn count<C: Component>(&mut self) -> usize {
        let world = self.app.world_mut();
        world.query::<&C>().iter(world).count()
    }

    fn only<C: Component>(&mut self) -> Result<Entity, String> {
        let world = self.app.world_mut();
        let mut found = world.query_filtered::<Entity, With<C>>();
        found.single(world).map_err(|error| format!("the scene is not the Cornell box: {error}"))
    }

    /// The picture, RGBA.
    pub fn picture(&self) -> Image {
        let world = self.app.sub_app(RenderApp).world();
        let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
        let images = world.resource::<RenderAssets<GpuImage>>();
        let source = &images.get(&self.target).expect("the target was drawn to").texture;
        let size = source.size();
        let row = 4 * size.width;
        let padded_row = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = device.wgpu_device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size: u64::from(padded_row * size.height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded_row), rows_per_image: None };
        encoder.copy_texture_to_buffer(
            source.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
            size,
        );
        queue.submit([encoder.finish()]);
        buffer.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.expect("the picture can be read"));
        device.wgpu_device().poll(wgpu::PollType::wait_indefinitely()).expect("the device is there");
        let bytes = buffer.slice(..).get_mapped_range().expect("the picture was mapped");
        let rows = bytes.chunks_exact(padded_row as usize).flat_map(|padded| &padded[..row as usize]);
        let format = TextureFormat::Rgba8UnormSrgb;
        Image::new(size, TextureDimension::D2, rows.copied().collect(), format, RenderAssetUsages::MAIN_WORLD)
    }
}

/// OUT/NAME.png.
pub fn save(picture: &Image, out: &Path, name: &str) -> Result<(), String> {
    let path = out.join(format!("{name}.png"));
    std::fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    let picture = picture.clone().try_into_dynamic().map_err(|error| error.to_string())?;
    picture.to_rgb8().save(&path).map_err(|error| format!("{}: {error}", path.display()))
}

fn app(folder: &Path) -> App {
    let assets = AssetPlugin { file_path: folder.to_string_lossy().into_owned(), ..default() };
    let no_window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    // A picture shows the frame that was drawn last, whole.
    let at_once = RenderPlugin { synchronous_pipeline_compilation: true, ..default() };
    let plugins = DefaultPlugins.set(assets).set(no_window).set(at_once);
    let mut app = App::new();
    app.add_plugins((plugins.disable::<WinitPlugin>().disable::<PipelinedRenderingPlugin>(), LocalprtPlugin))
        .insert_resource(GlobalAmbientLight::NONE)
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(PointLightShadowMap { size: 1024 })
        .insert_resource(DirectionalLightShadowMap { size: 2048 });
    while app.plugins_state() == bevy::app::PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    app
}

fn target_image(width: u32, height: u32) -> Image {
    let size = Extent3d { width, height, depth_or_array_layers: 1 };
    let format = TextureFormat::Rgba8UnormSrgb;
    let mut image = Image::new_uninit(size, TextureDimension::D2, format, RenderAssetUsages::RENDER_WORLD);
    image.texture_descriptor.usage =
        TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
    image
}
