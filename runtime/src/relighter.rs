//! The GPU passes in sequence: the only file that knows their order on the GPU.

mod inspect;
mod options;
#[cfg(test)]
mod tests;

pub use options::{DirectLight, MapPrecision, RelighterOptions, VolumeTextures};

use crate::error::RelightError;
use crate::gpu::{Timestamps, storage, zeros};
use crate::occluder::{Occluder, check_occluders};
use crate::passes::cluster_projection::ClusterProjectionPass;
use crate::passes::direct_irradiance::{DirectPass, DirectTimestamps};
use crate::passes::direct_lightmap::{DirectLightmapPass, Maps, Surface, SurfaceTexels};
use crate::passes::gutter_dilation::{GutterDilationPass, ReceiverMaps};
use crate::passes::lightmap_mips::{LightMap, LightmapMipsPass};
use crate::passes::near_light::NearLightPass;
use crate::passes::probe_relight::ProbeRelightPass;
use crate::passes::receiver_reconstruction::ReceiverReconstructionPass;
use crate::passes::shadow_map::ShadowCasters;
use crate::passes::volume_fill::GpuVolume;
use crate::scene_light::{caster, overrides_of, scene_texels};
use crate::sky::sky_sh;
use crate::surface::SceneTexels;
use crate::transport_pages::{self, TransportPage};
use crate::volume::Volume;
use glam::Vec3;
use localprt_formats::{Checked, MAX_LEVEL};
use localprt_scenes::{Light, Lighting, MaterialOverride, Scene};

/// Relights one baked file with compute shaders. The CPU reference of every pass is [`crate::CpuRelighter`].
///
/// Needs nothing beyond the limits that WebGPU guarantees. Everything set takes effect with the next
/// [`Relighter::encode`]; work set and encoded for one frame must be submitted before the next is set.
pub struct Relighter {
    device: wgpu::Device,
    queue: wgpu::Queue,
    options: RelighterOptions,
    sizes: Sizes,
    light_map: LightMap,
    maps: ReceiverMaps,
    pages: Vec<TransportPage>,
    probes: wgpu::Buffer,
    direct_lightmap: DirectLightmapPass,
    lightmap_mips: LightmapMipsPass,
    probe_relight: ProbeRelightPass,
    cluster_projection: ClusterProjectionPass,
    receiver_reconstruction: ReceiverReconstructionPass,
    near_light: Option<NearLightPass>,
    gutter_dilation: GutterDilationPass,
    volume: Option<GpuVolume>,
    direct_pass: Option<DirectPass>,
    /// Names of the scene's materials, where the scene is known.
    materials: Vec<String>,
    lights: Vec<Light>,
    lights_changed: bool,
    timestamps: Option<Timestamps>,
    must_clear: bool,
    /// Level 0 may hold texels that the surface does not cover.
    light_map_is_foreign: bool,
    gathers: u64,
}

/// Name of a pass and what records it.
type Pass = (&'static str, fn(&Relighter, &mut wgpu::ComputePass<'_>));

#[derive(Clone, Copy)]
struct Sizes {
    direct_size: u32,
    lightmap_size: u32,
    n_probes: usize,
    probe_degree: u32,
    n_sky: usize,
    sky_degree: u32,
    n_rays: usize,
    n_k: usize,
    has_distances: bool,
    /// Relight rays that read the light map.
    n_light_map_rays: u64,
}

impl Relighter {
    /// Uploads a file and compiles the passes. All light is zero.
    ///
    /// # Errors
    /// [`RelightError::Limit`] if the device is too small for the file, [`RelightError::AlbedoCap`].
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        baked: &Checked<'_>,
        options: RelighterOptions,
    ) -> Result<Self, RelightError> {
        if !(0.0..=1.0).contains(&options.feedback_albedo_cap) {
            return Err(RelightError::AlbedoCap { found: options.feedback_albedo_cap });
        }
        let metadata = baked.view().metadata;
        check_limits(device, baked)?;
        let light_map = LightMap::new(device, metadata.direct_size, options.light_map.format());
        let maps = ReceiverMaps::new(device, metadata.lightmap_size, baked.n_k(), options.irradiance_map.format());
        let pages = transport_pages::upload(device, baked.transport())?;
        let probe_relight = ProbeRelightPass::new(device, baked, &light_map);
        let transport = baked.transport();
        let n_columns = (transport.n_sh, transport.n_sky);
        Ok(Self {
            direct_lightmap: DirectLightmapPass::new(device, light_map.texture.format(), options.feedback_albedo_cap),
            lightmap_mips: LightmapMipsPass::new(device, &light_map),
            cluster_projection: ClusterProjectionPass::new(device, &pages, &probe_relight.probe_radiance, n_columns),
            receiver_reconstruction: ReceiverReconstructionPass::new(device, &pages, baked.n_k()),
            near_light: baked.has_near_light().then(|| NearLightPass::new(device, transport, &pages, &light_map)),
            gutter_dilation: GutterDilationPass::new(device, baked, &pages, &maps),
            volume: Volume::of(baked)
                .zip(baked.volume_transport())
                .map(|(cells, transport)| GpuVolume::new(device, &cells, transport, &probe_relight.probe_radiance))
                .transpose()?,
            probes: storage(device, "probes", bytemuck::cast_slice(baked.view().probes)),
            direct_pass: None,
            lights: Vec::new(),
            materials: Vec::new(),
            lights_changed: false,
            timestamps: Timestamps::new(device, queue),
            sizes: Sizes {
                direct_size: metadata.direct_size,
                lightmap_size: metadata.lightmap_size,
                n_probes: baked.n_probes(),
                probe_degree: metadata.probe_degree,
                n_sky: metadata.n_sky(),
                sky_degree: metadata.sky_degree,
                n_rays: baked.n_rays(),
                n_k: baked.n_k(),
                n_light_map_rays: baked.view().ray_level.iter().filter(|level| **level <= MAX_LEVEL).count() as u64,
                has_distances: !baked.view().ray_distance.is_empty(),
            },
            probe_relight,
            light_map,
            maps,
            pages,
            must_clear: true,
            light_map_is_foreign: false,
            gathers: 0,
            device: device.clone(),
            queue: queue.clone(),
            options,
        })
    }

    /// The scene that was baked, with its lightmap coordinates, and the file: for [`Relighter::set_lighting`] and
    /// [`DirectLight::Lights`]. Takes a while: rays find out which points of texels lie in the open. Nothing shines until a lighting
    /// is set.
    ///
    /// # Errors
    /// [`RelightError::Scene`], and those of [`Relighter::set_texels`].
    pub fn set_scene(&mut self, scene: &Scene, baked: &Checked<'_>) -> Result<(), RelightError> {
        let texels = scene_texels(&caster(scene)?, baked.view());
        self.set_texels(&texels, &ShadowCasters::of_scene(scene))?;
        self.materials = scene.materials.iter().map(|material| material.name.clone()).collect();
        self.set_lighting(&Lighting::default())
    }

    /// Lights, sky and materials, all at once, of the scene that was set.
    ///
    /// # Errors
    /// [`RelightError::NoScene`], [`RelightError::NotFinite`].
    pub fn set_lighting(&mut self, lighting: &Lighting) -> Result<(), RelightError> {
        if self.direct_pass.is_none() {
            return Err(RelightError::NoScene);
        }
        let overrides = overrides_of(self.materials.iter().map(String::as_str), lighting);
        self.set_materials(&overrides, lighting.albedo_override)?;
        self.set_sky(&sky_sh(&lighting.sky, self.sizes.sky_degree), &[])?;
        self.set_lights(&lighting.lights);
        Ok(())
    }

    /// Surfaces for [`DirectLight::Lights`], and what casts shadows on them. Materials are the scene's own, and there are no
    /// lights, until set.
    ///
    /// # Errors
    /// Those of [`SceneTexels::check`] and [`ShadowCasters::check`]; [`RelightError::Limit`]. The scene before is then
    /// still there.
    pub fn set_texels(&mut self, texels: &SceneTexels, casters: &ShadowCasters) -> Result<(), RelightError> {
        texels.check(self.sizes.direct_size)?;
        if let Some(&material) = texels.material.iter().find(|material| **material > u32::from(u16::MAX)) {
            let allowed = u64::from(u16::MAX);
            return Err(RelightError::Limit { what: "material index", needed: material.into(), allowed });
        }
        let mut direct_pass = DirectPass::new(&self.device, &self.options.direct);
        direct_pass.set_scene(&self.device, texels, casters)?;
        let surface = Surface {
            size: texels.size,
            index: &texels.index,
            lightmap_uv: &texels.lightmap_uv,
            albedo: &texels.albedo,
            emission: &texels.emission,
            material: &texels.material,
        };
        self.upload_surface(&surface, direct_pass.irradiance_buffer().clone());
        self.direct_pass = Some(direct_pass);
        self.materials.clear();
        self.lights.clear();
        self.lights_changed = true;
        Ok(())
    }

    /// The lights of [`DirectLight::Lights`], any number.
    pub fn set_lights(&mut self, lights: &[Light]) {
        self.lights_changed |= self.lights != lights;
        self.lights = lights.to_vec();
    }

    /// Triangles that cast shadows besides those of the scene and may be others every frame, such as moving objects; none
    /// until set, and none after a scene is set.
    ///
    /// # Errors
    /// [`RelightError::NoScene`], those of [`ShadowCasters::check`], [`RelightError::Limit`].
    pub fn set_moving_casters(&mut self, casters: &ShadowCasters) -> Result<(), RelightError> {
        let direct_pass = self.direct_pass.as_mut().ok_or(RelightError::NoScene)?;
        direct_pass.set_moving_casters(&self.device, casters)?;
        self.lights_changed = true;
        Ok(())
    }

    /// Lights and shadow maps for the host's own shaders: see [`DirectPass::light_layout`] and
    /// [`DirectPass::light_group`]. `None` without a scene.
    pub fn direct_pass(&self) -> Option<&DirectPass> {
        self.direct_pass.as_ref()
    }

    /// Surface facts and direct irradiance at once, as the CPU relighter takes them; no material table, no shadow maps.
    ///
    /// # Errors
    /// Those of [`SurfaceTexels::check`]; [`RelightError::Limit`].
    pub fn set_surface(&mut self, surface: &SurfaceTexels) -> Result<(), RelightError> {
        surface.check(self.sizes.direct_size)?;
        let (needed, allowed) = (surface.len() as u64 * 16, self.device.limits().max_buffer_size);
        if needed > allowed {
            return Err(RelightError::Limit { what: "direct irradiance, bytes", needed, allowed });
        }
        self.upload_surface(&Surface::of_texels(surface), zeros(&self.device, "direct_lightmap.direct", needed));
        self.direct_pass = None;
        self.direct_lightmap.set_direct(&self.queue, &surface.direct);
        Ok(())
    }

    fn upload_surface(&mut self, surface: &Surface<'_>, direct: wgpu::Buffer) {
        // Texels that another scene covered must be uncovered again.
        self.light_map_is_foreign |= self.direct_lightmap.n_texels() > 0;
        let maps = Maps {
            irradiance: &self.maps.irradiance_view,
            irradiance_size: self.sizes.lightmap_size,
            light_map_level_0: &self.light_map.levels[0],
        };
        self.direct_lightmap.set_surface(&self.device, surface, direct, &maps);
    }

    /// Irradiance straight from punctual lights, W m^-2, one value per covered texel of the last surface.
    ///
    /// # Errors
    /// [`RelightError::Length`], [`RelightError::NotFinite`].
    pub fn set_direct(&mut self, direct: &[Vec3]) -> Result<(), RelightError> {
        check_colors("surface direct", direct, self.direct_lightmap.n_texels())?;
        self.direct_lightmap.set_direct(&self.queue, direct);
        // The shadow-mapped irradiance is gone from the same place.
        self.lights_changed = true;
        Ok(())
    }

    /// Overrides of albedo and emission by material index; materials beyond the list, and `None`, are the scene's own.
    ///
    /// # Errors
    /// [`RelightError::NotFinite`].
    pub fn set_materials(
        &mut self,
        overrides: &[MaterialOverride],
        albedo_override: Option<f32>,
    ) -> Result<(), RelightError> {
        let is_finite = |color: Option<Vec3>| color.is_none_or(Vec3::is_finite);
        if let Some(index) = overrides.iter().position(|own| !is_finite(own.albedo) || !is_finite(own.emission)) {
            return Err(RelightError::NotFinite { what: "material", index });
        }
        self.direct_lightmap.set_materials(&self.queue, overrides, albedo_override);
        Ok(())
    }

    /// The sky: SH radiance for receivers, and radiance along the relight rays for probes. Empty is black; `sky_rays` is
    /// best left empty (see [`crate::RelightInputs::sky_in_probes`]).
    ///
    /// # Errors
    /// [`RelightError::Length`], [`RelightError::NotFinite`].
    pub fn set_sky(&mut self, sky_sh: &[Vec3], sky_rays: &[Vec3]) -> Result<(), RelightError> {
        for (what, sky, expected) in [
            ("sky SH radiance", sky_sh, self.sizes.n_sky),
            ("sky radiance per relight ray", sky_rays, self.sizes.n_rays),
        ] {
            if !sky.is_empty() {
                check_colors(what, sky, expected)?;
            }
        }
        self.cluster_projection.set_sky(&self.queue, sky_sh);
        if let Some(volume) = &self.volume {
            volume.set_sky(&self.queue, sky_sh);
        }
        self.probe_relight.set_sky_rays(&self.queue, sky_rays);
        Ok(())
    }

    /// Objects that block relight rays; links of near light pass through them.
    ///
    /// # Errors
    /// [`RelightError::Occluders`] if there are too many, one is not valid, or the file has no ray distances.
    pub fn set_occluders(&mut self, occluders: &[Occluder]) -> Result<(), RelightError> {
        check_occluders(occluders, self.sizes.has_distances)?;
        self.probe_relight.set_occluders(&self.queue, occluders);
        Ok(())
    }

    /// Gathers per frame.
    pub fn set_bounces(&mut self, bounces: u32) {
        self.options.bounces = bounces.max(1);
    }

    /// Forgets all light, so that the next frame starts with a first bounce. For cuts and teleports.
    pub fn reset(&mut self) {
        self.must_clear = true;
    }

    /// Records one frame: the light map, then gather after gather up to the maps that the host samples.
    ///
    /// # Errors
    /// [`RelightError::MapSize`] for a texture of another size than the file's `direct_size`; [`RelightError::NoScene`] for
    /// [`DirectLight::Lights`] without a scene.
    pub fn encode(&mut self, encoder: &mut wgpu::CommandEncoder, direct: &DirectLight<'_>) -> Result<(), RelightError> {
        if let DirectLight::Texture(view) = direct {
            let expected = self.sizes.direct_size;
            let sides = [view.texture().width(), view.texture().height()];
            if let Some(&found) = sides.iter().find(|side| **side != expected) {
                return Err(RelightError::MapSize { expected, found });
            }
        }
        if matches!(direct, DirectLight::Lights) && self.direct_pass.is_none() {
            return Err(RelightError::NoScene);
        }
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.begin_frame();
        }
        if matches!(direct, DirectLight::Lights) && self.lights_changed {
            self.encode_lights(encoder);
        }
        if self.must_clear {
            let volume_pages = self.volume.iter().flat_map(|volume| &volume.pages);
            for page in self.pages.iter().chain(volume_pages) {
                encoder.clear_buffer(&page.coefficients, 0, None);
            }
            self.pass(encoder, "gutter_dilation", |this, pass| this.gutter_dilation.encode(pass));
            self.must_clear = false;
            self.gathers = 0;
        }
        let from_host = matches!(direct, DirectLight::Texture(_));
        if self.light_map_is_foreign && !from_host {
            self.light_map.clear_level_0(&self.queue);
        }
        self.light_map_is_foreign = from_host;
        let bounces = if from_host { 1 } else { self.options.bounces };
        for _ in 0..bounces {
            self.pass(encoder, "direct_lightmap", |this, pass| match direct {
                DirectLight::Lights | DirectLight::Irradiance => this.direct_lightmap.encode(pass),
                DirectLight::Texture(view) => this.direct_lightmap.encode_host_map(
                    &this.device,
                    pass,
                    view,
                    &this.light_map.levels[0],
                    this.sizes.direct_size,
                ),
            });
            self.pass(encoder, "lightmap_mips", |this, pass| this.lightmap_mips.encode(pass));
            self.pass(encoder, "probe_relight", |this, pass| this.probe_relight.encode(pass));
            self.pass(encoder, "cluster_projection", |this, pass| this.cluster_projection.encode(pass));
            self.pass(encoder, "receiver_reconstruction", |this, pass| this.receiver_reconstruction.encode(pass));
            if self.near_light.is_some() {
                self.pass(encoder, "near_light", Self::encode_near_light);
            }
            self.pass(encoder, "gutter_dilation", |this, pass| this.gutter_dilation.encode(pass));
            self.gathers += 1;
        }
        // The volume feeds nothing back: once, after the last gather.
        if self.volume.is_some() {
            for (name, record) in GpuVolume::PASSES {
                self.pass(encoder, name, |this, pass| this.volume.iter().for_each(|volume| record(volume, pass)));
            }
        }
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.end_frame(encoder);
        }
        Ok(())
    }

    /// Records one pass of a gather alone, by its name in [`Relighter::traffic`], for measuring; false for a name that is
    /// none. `near_light` adds to the light of the passes before it, every time.
    pub fn encode_pass(&mut self, encoder: &mut wgpu::CommandEncoder, name: &str) -> bool {
        let passes: [Pass; 7] = [
            ("direct_lightmap", |this, pass| this.direct_lightmap.encode(pass)),
            ("lightmap_mips", |this, pass| this.lightmap_mips.encode(pass)),
            ("probe_relight", |this, pass| this.probe_relight.encode(pass)),
            ("cluster_projection", |this, pass| this.cluster_projection.encode(pass)),
            ("receiver_reconstruction", |this, pass| this.receiver_reconstruction.encode(pass)),
            ("near_light", Self::encode_near_light),
            ("gutter_dilation", |this, pass| this.gutter_dilation.encode(pass)),
        ];
        let Some((name, record)) = passes.into_iter().find(|(known, _)| *known == name) else { return false };
        self.pass(encoder, name, record);
        true
    }

    /// Nothing where the file has no near light.
    fn encode_near_light(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.near_light.iter().for_each(|near_light| near_light.encode(pass));
    }

    /// Shadow maps and direct irradiance.
    fn encode_lights(&mut self, encoder: &mut wgpu::CommandEncoder) {
        let Some(direct_pass) = &mut self.direct_pass else { return };
        let mut spans = [None; 2];
        if let Some(timestamps) = &mut self.timestamps {
            spans = ["shadow_map", "direct_irradiance"].map(|name| timestamps.reserve(name));
        }
        let query_set = self.timestamps.as_ref().map(Timestamps::queries);
        let [shadow_maps, irradiance] =
            spans.map(|span| query_set.zip(span).map(|(queries, (begin, end))| (queries, begin, end)));
        let timestamps = DirectTimestamps { shadow_maps, irradiance };
        direct_pass.encode(&self.device, &self.queue, encoder, &self.lights, timestamps);
        self.lights_changed = false;
    }

    /// One compute pass with its name and its time.
    fn pass(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        name: &'static str,
        record: impl FnOnce(&Self, &mut wgpu::ComputePass<'_>),
    ) {
        let span = self.timestamps.as_mut().and_then(|timestamps| timestamps.reserve(name));
        let queries = self.timestamps.as_ref().map(Timestamps::queries);
        let timestamp_writes = queries.zip(span).map(|(query_set, (begin, end))| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(end),
        });
        let label = format!("localprt.{name}");
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(&label), timestamp_writes });
        record(self, &mut pass);
    }

    /// Gathers since the last reset.
    pub fn gathers(&self) -> u64 {
        self.gathers
    }

    /// Indirect irradiance, W m^-2, `lightmap_size` texels per side; alpha 1 where a receiver or a gutter is. Sample with
    /// TEXCOORD_1.
    pub fn irradiance_view(&self) -> &wgpu::TextureView {
        &self.maps.irradiance_view
    }

    /// SH radiance of degree 1 in world axes, four layers of one coefficient each (0; y; z; x), for normal maps and
    /// specular light. `None` for a file of receiver degree 0.
    pub fn radiance_view(&self) -> Option<&wgpu::TextureView> {
        (self.sizes.n_k == 4).then_some(&self.maps.radiance_view)
    }

    /// Light in the open space for objects that move, if the file has a volume.
    pub fn volume(&self) -> Option<VolumeTextures<'_>> {
        let volume = self.volume.as_ref()?;
        Some(VolumeTextures { grid: &volume.grid, coefficients: &volume.views })
    }

    /// The probes, `[n_probes]` of vec4f: position and support radius, metres. For shaders that gather from them.
    pub fn probes(&self) -> &wgpu::Buffer {
        &self.probes
    }

    /// Number of probes.
    pub fn n_probes(&self) -> usize {
        self.sizes.n_probes
    }

    /// SH degree of the probes.
    pub fn probe_degree(&self) -> u32 {
        self.sizes.probe_degree
    }

    /// SH radiance of the probes, `[n_probes, n_sh]` of vec4f, for display.
    pub fn probe_radiance(&self) -> &wgpu::Buffer {
        &self.probe_relight.probe_radiance
    }

    /// Levels of outgoing radiance times coverage, coverage; the texture is the next power of two wide.
    pub fn light_map(&self) -> &wgpu::Texture {
        &self.light_map.texture
    }
}

/// What cannot be paged.
fn check_limits(device: &wgpu::Device, baked: &Checked<'_>) -> Result<(), RelightError> {
    let limits = device.limits();
    let metadata = baked.view().metadata;
    let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let texture = u64::from(limits.max_texture_dimension_2d);
    let n_sh = baked.n_sh() as u64;
    for (what, needed, allowed) in [
        ("direct light map, texels per side", u64::from(metadata.direct_size.next_power_of_two()), texture),
        ("irradiance map, texels per side", u64::from(metadata.lightmap_size), texture),
        ("probe radiance, bytes", baked.n_probes() as u64 * n_sh * 16, binding),
        ("SH table of the relight rays, bytes", baked.n_rays() as u64 * n_sh * 4, binding),
    ] {
        if needed > allowed {
            return Err(RelightError::Limit { what, needed, allowed });
        }
    }
    Ok(())
}

fn check_colors(what: &'static str, colors: &[Vec3], expected: usize) -> Result<(), RelightError> {
    if colors.len() != expected {
        return Err(RelightError::Length { what, expected, found: colors.len() });
    }
    match colors.iter().position(|color| !color.is_finite()) {
        Some(index) => Err(RelightError::NotFinite { what, index }),
        None => Ok(()),
    }
}
