//! The CPU twins in sequence: the only file that knows their order.

use crate::coverage_map::CoverageMap;
use crate::error::RelightError;
use crate::light_maps::LightMaps;
use crate::occluder::{Occluder, check_occluders};
use crate::passes::cluster_projection::cluster_projection;
use crate::passes::direct_lightmap::{SurfaceTexels, direct_lightmap};
use crate::passes::lightmap_mips::{level_sizes, lightmap_mips};
use crate::passes::near_light::near_light;
use crate::passes::probe_relight::probe_relight;
use crate::passes::receiver_reconstruction::{cosine_weights, receiver_irradiance, receiver_reconstruction};
use crate::passes::volume_fill::{VolumeSampler, volume_fill};
use crate::scene_light::{SceneLight, caster, scene_texels};
use crate::surface::SceneTexels;
use crate::volume::Volume;
use glam::Vec3;
use localprt_formats::Checked;
use localprt_scenes::{Lighting, Scene};
use localprt_surfaces::rays::RayCaster;
use std::{fmt, sync::Arc};

/// Limit of the albedo in the feedback: leaves 5 % for a reconstruction whose gain ringing pushes above 1.
pub const DEFAULT_FEEDBACK_ALBEDO_CAP: f32 = 0.95;

/// What shines in one relight. Colors are linear Rec. 709.
#[derive(Clone, Copy, Debug)]
pub struct RelightInputs<'a> {
    /// Albedo, emission and direct irradiance in the texels of the direct light map.
    pub surface: &'a SurfaceTexels,
    /// `[n_sky]` SH radiance of the sky, for the sky columns of the clusters; empty is a black sky.
    pub sky_sh: &'a [Vec3],
    /// `[n_rays]` radiance of the sky along the file's `ray_dirs`, W sr^-1 m^-2; empty is a black sky.
    pub sky_rays: &'a [Vec3],
    /// Relight rays that leave the scene read the sky. Receivers get the sky through `sky_sh` in any case, and look up
    /// surfaces only in the probes, so this serves other uses of the probe radiance; the band limit makes it leak onto
    /// surfaces beside openings (Sponza under a sky: nrmse 0.107 instead of 0.015).
    pub sky_in_probes: bool,
    /// Objects that block relight rays.
    pub occluders: &'a [Occluder],
    /// Gathers of [`CpuRelighter::relight`]: 1 is the first indirect bounce, 0 gives no indirect light.
    pub bounces: u32,
    /// Limit of the albedo that multiplies the previous gather's irradiance, 0..=1.
    pub feedback_albedo_cap: f32,
}

impl<'a> RelightInputs<'a> {
    /// One bounce under a black sky.
    pub fn new(surface: &'a SurfaceTexels) -> Self {
        Self {
            surface,
            sky_sh: &[],
            sky_rays: &[],
            sky_in_probes: false,
            occluders: &[],
            bounces: 1,
            feedback_albedo_cap: DEFAULT_FEEDBACK_ALBEDO_CAP,
        }
    }
}

/// Indirect light at the receivers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Relit {
    /// `[n_receivers, n_k]` transported coefficients, not clamped: irradiance for degree 0, SH coefficients whose
    /// convolution with the cosine is irradiance for degree 1.
    pub coefficients: Vec<Vec3>,
    /// `[n_receivers]` irradiance about the shading normal, W m^-2, not negative.
    pub irradiance: Vec<Vec3>,
    /// The same in the receiver map's texels.
    pub maps: LightMaps,
}

impl Relit {
    /// Irradiance and its map from `[n_receivers, n_k]` transported coefficients, wherever they were computed.
    ///
    /// # Panics
    /// If `coefficients` does not have the length of the file.
    pub fn of_coefficients(baked: &Checked<'_>, coefficients: Vec<Vec3>) -> Self {
        let mut irradiance = vec![Vec3::ZERO; baked.n_receivers()];
        receiver_irradiance(&cosine_weights(baked), &coefficients, &mut irradiance);
        let mut maps = LightMaps::uncovered(baked);
        maps.write(baked, &irradiance, &coefficients);
        Self { coefficients, irradiance, maps }
    }
}

/// Relights one baked file on the CPU; the reference of the GPU passes.
///
/// Results do not depend on the number of rayon threads.
#[derive(Clone, Debug)]
pub struct CpuRelighter<'a> {
    baked: Checked<'a>,
    /// `[n_receivers]` for degree 1, else empty.
    cosine_weights: Vec<[f32; 4]>,
    cells: Option<Volume<'a>>,
    light_map: Vec<CoverageMap>,
    probe_radiance: Vec<Vec3>,
    cluster_lights: Vec<Vec3>,
    relit: Relit,
    volume: VolumeLight,
    gathers: u64,
    scene: Option<Arc<OpenScene<'a>>>,
    /// What shines in it.
    light: Arc<SceneLight>,
}

/// A scene, ready to be lit.
struct OpenScene<'a> {
    caster: RayCaster<'a>,
    texels: SceneTexels,
}

impl fmt::Debug for OpenScene<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("OpenScene").field("texels", &self.texels.len()).finish_non_exhaustive()
    }
}

/// Light of the volume; empty arrays without one.
#[derive(Clone, Debug, Default)]
struct VolumeLight {
    cluster_lights: Vec<Vec3>,
    /// `[n_volume_receivers, n_k]`.
    coefficients: Vec<Vec3>,
    /// `[n_cells, n_k]`.
    cells: Vec<Vec3>,
}

impl<'a> CpuRelighter<'a> {
    /// All light is zero.
    pub fn new(baked: Checked<'a>) -> Self {
        let metadata = baked.view().metadata;
        let mut relighter = Self {
            light_map: level_sizes(metadata.direct_size).into_iter().map(CoverageMap::uncovered).collect(),
            probe_radiance: vec![Vec3::ZERO; baked.n_probes() * baked.n_sh()],
            cluster_lights: vec![Vec3::ZERO; baked.n_cluster_lights()],
            relit: Relit {
                coefficients: vec![Vec3::ZERO; baked.n_receivers() * baked.n_k()],
                irradiance: vec![Vec3::ZERO; baked.n_receivers()],
                maps: LightMaps::uncovered(&baked),
            },
            volume: VolumeLight::default(),
            gathers: 0,
            scene: None,
            light: Arc::default(),
            cosine_weights: cosine_weights(&baked),
            cells: Volume::of(&baked),
            baked,
        };
        if let (Some(cells), Some(transport)) = (&relighter.cells, relighter.baked.volume_transport()) {
            relighter.volume = VolumeLight {
                cluster_lights: vec![Vec3::ZERO; transport.n_lights],
                coefficients: vec![Vec3::ZERO; transport.n_receivers * transport.n_k],
                cells: vec![Vec3::ZERO; cells.n_cells() * transport.n_k],
            };
        }
        relighter.write_maps();
        relighter
    }

    /// The scene that was baked, with its lightmap coordinates: for [`CpuRelighter::set_lighting`]. Takes a while: rays find out
    /// which points of texels lie in the open. Nothing shines until a lighting is set.
    ///
    /// # Errors
    /// [`RelightError::Scene`].
    pub fn set_scene(&mut self, scene: &'a Scene) -> Result<(), RelightError> {
        let caster = caster(scene)?;
        let texels = scene_texels(&caster, self.baked.view());
        self.scene = Some(Arc::new(OpenScene { caster, texels }));
        self.set_lighting(&Lighting::default())
    }

    /// Lights, sky and materials, all at once, of the scene that was set; shadows are traced.
    ///
    /// # Errors
    /// [`RelightError::NoScene`], and those of [`CpuRelighter::check`]; the lighting before is then still there.
    pub fn set_lighting(&mut self, lighting: &Lighting) -> Result<(), RelightError> {
        let OpenScene { caster, texels } = &**self.scene.as_ref().ok_or(RelightError::NoScene)?;
        let light = SceneLight::traced(caster, texels, lighting, self.baked.view());
        self.check(&light.inputs(1))?;
        self.light = Arc::new(light);
        Ok(())
    }

    /// One more gather in the lighting that was set, starting from the light of the last: one more bounce per frame.
    ///
    /// # Errors
    /// [`RelightError::NoScene`], those of [`CpuRelighter::check`].
    pub fn bounce(&mut self) -> Result<&Relit, RelightError> {
        if self.scene.is_none() {
            return Err(RelightError::NoScene);
        }
        let light = Arc::clone(&self.light);
        self.step(&light.inputs(1))
    }

    /// Forgets all light, then does `inputs.bounces` gathers.
    ///
    /// A Jacobi iteration: gather k reads `Le + albedo/pi (D + E)` with the irradiance E of gather k - 1.
    ///
    /// # Errors
    /// Those of [`CpuRelighter::check`]; the light of the last relight then stays as it was.
    pub fn relight(&mut self, inputs: &RelightInputs<'_>) -> Result<&Relit, RelightError> {
        self.check(inputs)?;
        self.reset();
        for _ in 0..inputs.bounces {
            self.gather(inputs);
        }
        // Nothing reads the volume before the last gather.
        if inputs.bounces > 0 {
            self.light_volume(inputs);
        }
        Ok(&self.relit)
    }

    /// One gather that starts from the light of the last one: one more bounce per frame, for lights that move.
    ///
    /// `inputs.bounces` plays no part.
    ///
    /// # Errors
    /// Those of [`CpuRelighter::check`]; the light of the last gather then stays as it was.
    pub fn step(&mut self, inputs: &RelightInputs<'_>) -> Result<&Relit, RelightError> {
        self.check(inputs)?;
        self.gather(inputs);
        self.light_volume(inputs);
        Ok(&self.relit)
    }

    /// Sets all light to zero, so that the next [`CpuRelighter::step`] is a first bounce.
    pub fn reset(&mut self) {
        self.gathers = 0;
        self.light_map.iter_mut().for_each(|level| level.texels_mut().fill(glam::Vec4::ZERO));
        self.probe_radiance.fill(Vec3::ZERO);
        self.cluster_lights.fill(Vec3::ZERO);
        self.relit.coefficients.fill(Vec3::ZERO);
        self.relit.irradiance.fill(Vec3::ZERO);
        self.volume.cells.fill(Vec3::ZERO);
        self.write_maps();
    }

    /// Checks that inputs fit the file and are finite.
    ///
    /// # Errors
    /// Those of [`SurfaceTexels::check`]; [`RelightError::Length`] and [`RelightError::NotFinite`] for the sky;
    /// [`RelightError::AlbedoCap`]; [`RelightError::Occluders`].
    pub fn check(&self, inputs: &RelightInputs<'_>) -> Result<(), RelightError> {
        let metadata = self.baked.view().metadata;
        inputs.surface.check(metadata.direct_size)?;
        for (what, sky, expected) in [
            ("sky SH radiance", inputs.sky_sh, metadata.n_sky()),
            ("sky radiance per relight ray", inputs.sky_rays, self.baked.n_rays()),
        ] {
            if !sky.is_empty() && sky.len() != expected {
                return Err(RelightError::Length { what, expected, found: sky.len() });
            }
            if let Some(index) = sky.iter().position(|value| !value.is_finite()) {
                return Err(RelightError::NotFinite { what, index });
            }
        }
        check_occluders(inputs.occluders, !self.baked.view().ray_distance.is_empty())?;
        if !(0.0..=1.0).contains(&inputs.feedback_albedo_cap) {
            return Err(RelightError::AlbedoCap { found: inputs.feedback_albedo_cap });
        }
        Ok(())
    }

    /// Light of the last gather at the receivers.
    pub fn relit(&self) -> &Relit {
        &self.relit
    }

    /// `[n_cells, n_k]` SH radiance in the cells of the volume, from the probes of the last gather; `None` without a volume.
    ///
    /// Cells inside geometry hold the values of a valid one near by, or 0: [`CpuRelighter::volume_cells`] tells by cell.
    pub fn volume(&self) -> Option<&[Vec3]> {
        self.cells.as_ref().map(|_| self.volume.cells.as_slice())
    }

    /// Light at any place of the volume; `None` without a volume.
    pub fn volume_sampler(&self) -> Option<VolumeSampler<'_>> {
        self.volume_cells().map(|cells| VolumeSampler::new(cells, &self.volume.cells))
    }

    /// Where the cells of the volume lie, and which of them hold light; `None` without a volume.
    pub fn volume_cells(&self) -> Option<&Volume<'a>> {
        self.cells.as_ref()
    }

    /// Gathers since the last reset: bounces the current light holds.
    pub fn gathers(&self) -> u64 {
        self.gathers
    }

    /// Levels of the light map that the last gather read: outgoing radiance, W sr^-1 m^-2; level 0 has `direct_size`.
    pub fn light_map(&self) -> &[CoverageMap] {
        &self.light_map
    }

    /// `[n_probes, n_sh]` SH radiance of the probes in the last gather.
    pub fn probe_radiance(&self) -> &[Vec3] {
        &self.probe_radiance
    }

    /// `[sum of n_coefficients]` cluster lights of the last gather.
    pub fn cluster_lights(&self) -> &[Vec3] {
        &self.cluster_lights
    }

    /// The checked file.
    pub fn baked(&self) -> &Checked<'a> {
        &self.baked
    }

    fn gather(&mut self, inputs: &RelightInputs<'_>) {
        let baked = &self.baked;
        let previous = (self.gathers > 0).then_some(&self.relit.maps.irradiance);
        direct_lightmap(inputs.surface, previous, inputs.feedback_albedo_cap, &mut self.light_map[0]);
        lightmap_mips(&mut self.light_map);
        let sky_rays = if inputs.sky_in_probes { inputs.sky_rays } else { &[] };
        probe_relight(baked, &self.light_map, sky_rays, inputs.occluders, &mut self.probe_radiance);
        cluster_projection(baked.transport(), &self.probe_radiance, inputs.sky_sh, &mut self.cluster_lights);
        receiver_reconstruction(baked.transport(), &self.cluster_lights, &mut self.relit.coefficients);
        near_light(baked.transport(), &self.light_map, &mut self.relit.coefficients);
        receiver_irradiance(&self.cosine_weights, &self.relit.coefficients, &mut self.relit.irradiance);
        self.write_maps();
        self.gathers += 1;
    }

    fn write_maps(&mut self) {
        let Relit { coefficients, irradiance, maps } = &mut self.relit;
        maps.write(&self.baked, irradiance, coefficients);
    }

    /// Lights the volume by the probes of the last gather; it feeds nothing back.
    fn light_volume(&mut self, inputs: &RelightInputs<'_>) {
        let (Some(volume), Some(transport)) = (&self.cells, self.baked.volume_transport()) else { return };
        let VolumeLight { cluster_lights, coefficients, cells } = &mut self.volume;
        cluster_projection(transport, &self.probe_radiance, inputs.sky_sh, cluster_lights);
        receiver_reconstruction(transport, cluster_lights, coefficients);
        volume_fill(volume, coefficients, cells);
    }
}

#[cfg(test)]
mod tests;
