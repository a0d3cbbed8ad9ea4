//! What a relighter tells about itself: times, bytes that passes move, device memory, and its light in numbers.

use super::Relighter;
use crate::error::RelightError;
use crate::gpu::{PassTime, readback};
use crate::passes::direct_irradiance::DirectPass;
use crate::passes::volume_fill::GpuVolume;
use crate::transport_pages::TransportPage;
use glam::Vec3;

impl Relighter {
    /// GPU time per pass of a recent frame, when it has arrived; call it once per frame after submitting. `None` also on
    /// devices without `Features::TIMESTAMP_QUERY`.
    ///
    /// With more lights than fit into the layers of the shadow maps, `shadow_map` and `direct_irradiance` take turns, and
    /// either time runs from the first turn to the last.
    pub fn pass_times(&mut self) -> Option<Vec<PassTime>> {
        self.timestamps.as_mut()?.take()
    }

    /// The same for the last submitted frame, waiting for it.
    pub fn wait_for_pass_times(&mut self) -> Option<Vec<PassTime>> {
        if let Some(times) = self.pass_times() {
            return Some(times);
        }
        self.device.poll(wgpu::PollType::wait_indefinitely()).ok()?;
        self.pass_times()
    }

    /// `[n_receivers, n_k]` transported coefficients, not clamped. Waits for the GPU; for tests and tools.
    ///
    /// # Errors
    /// [`RelightError::Device`].
    pub fn read_coefficients(&self) -> Result<Vec<Vec3>, RelightError> {
        let mut all = Vec::new();
        for page in self.pages.iter().filter(|page| !page.receivers.is_empty()) {
            let values = self.read_colors(&page.coefficients)?;
            all.extend_from_slice(&values[..page.receivers.len() * self.sizes.n_k]);
        }
        Ok(all)
    }

    /// Cluster lights of all clusters. Waits for the GPU.
    ///
    /// # Errors
    /// [`RelightError::Device`].
    pub fn read_cluster_lights(&self) -> Result<Vec<Vec3>, RelightError> {
        let mut all = Vec::new();
        for page in &self.pages {
            all.extend_from_slice(&self.read_colors(&page.cluster_lights)?[..page.n_lights]);
        }
        Ok(all)
    }

    /// `[n_probes, n_sh]` probe radiance. Waits for the GPU.
    ///
    /// # Errors
    /// [`RelightError::Device`].
    pub fn read_probe_radiance(&self) -> Result<Vec<Vec3>, RelightError> {
        self.read_colors(&self.probe_relight.probe_radiance)
    }

    fn read_colors(&self, buffer: &wgpu::Buffer) -> Result<Vec<Vec3>, RelightError> {
        let bytes = readback::buffer(&self.device, &self.queue, buffer)?;
        Ok(bytes.chunks_exact(16).map(|color| bytemuck::pod_read_unaligned(&color[..12])).collect())
    }

    /// Bytes that the passes of one gather, by name, have to move, each array once however often caches are missed: what their
    /// times are to be measured against. Relight rays count all four texels that they read.
    pub fn traffic(&self) -> Vec<(&'static str, u64)> {
        let pages = |size: fn(&TransportPage) -> u64| self.pages.iter().map(size).sum::<u64>();
        let texel = |texture: &wgpu::Texture| u64::from(texture.format().block_copy_size(None).unwrap_or(16));
        let size = u64::from(self.sizes.direct_size);
        let light_map_texel = texel(&self.light_map.texture);
        let lights = pages(|page| page.cluster_lights.size());
        let coefficients = pages(|page| page.coefficients.size());
        let n_fills = self.gutter_dilation.n_fills();
        let irradiance_map = n_fills * texel(&self.maps.irradiance);
        let lookups = 4 * light_map_texel * self.sizes.n_light_map_rays;
        let near_light = self
            .near_light
            .as_ref()
            .map(|near| ("near_light", near.bytes() + near.n_nodes() * light_map_texel + 2 * coefficients));
        let passes = [
            ("direct_lightmap", self.direct_lightmap.traffic(light_map_texel) + irradiance_map),
            // Every level but the last is read; every level but the first is written.
            ("lightmap_mips", size * size * light_map_texel * 5 / 3),
            ("probe_relight", self.probe_relight.traffic() + lookups),
            (
                "cluster_projection",
                pages(|page| page.projection.size() + page.clusters.size() + page.cluster_probes.size())
                    + self.probe_relight.probe_radiance.size()
                    + lights,
            ),
            (
                "receiver_reconstruction",
                pages(|page| page.reconstruction.size() + page.clusters.size() + page.receiver_cluster.size())
                    + lights
                    + coefficients,
            ),
        ];
        let gutter_dilation = (
            "gutter_dilation",
            self.gutter_dilation.bytes() + n_fills * (16 * self.sizes.n_k as u64 + texel(&self.maps.irradiance)),
        );
        passes.into_iter().chain(near_light).chain([gutter_dilation]).collect()
    }

    /// `[n_volume_receivers, n_k]` coefficients of the volume's valid cells; empty without a volume. Waits for the GPU.
    ///
    /// # Errors
    /// [`RelightError::Device`].
    pub fn read_volume(&self) -> Result<Vec<Vec3>, RelightError> {
        let mut all = Vec::new();
        if let Some(volume) = &self.volume {
            for page in volume.pages.iter().filter(|page| !page.receivers.is_empty()) {
                all.extend_from_slice(&self.read_colors(&page.coefficients)?[..page.receivers.len() * volume.n_k]);
            }
        }
        Ok(all)
    }

    /// Device memory by purpose, bytes.
    pub fn memory(&self) -> Vec<(&'static str, u64)> {
        let pages = |size: fn(&TransportPage) -> u64| self.pages.iter().map(size).sum::<u64>();
        let texture = |texture: &wgpu::Texture| {
            let texel = u64::from(texture.format().block_copy_size(None).unwrap_or(16));
            (0..texture.mip_level_count())
                .map(|level| {
                    let size = texture.size().mip_level_size(level, texture.dimension());
                    u64::from(size.width) * u64::from(size.height) * u64::from(size.depth_or_array_layers) * texel
                })
                .sum::<u64>()
        };
        let mut memory = vec![
            ("projection", pages(|page| page.projection.size())),
            ("reconstruction", pages(|page| page.reconstruction.size())),
            ("clusters and their probes", pages(|page| page.clusters.size() + page.cluster_probes.size())),
            ("cluster of each receiver", pages(|page| page.receiver_cluster.size())),
            ("cluster lights", pages(|page| page.cluster_lights.size())),
            ("receiver coefficients", pages(|page| page.coefficients.size())),
            ("texels of receivers and gutters", self.gutter_dilation.bytes()),
            ("probes", self.probes.size()),
        ];
        memory.extend(self.near_light.as_ref().map(|near| ("near light", near.bytes())));
        memory.extend_from_slice(self.probe_relight.memory());
        memory.extend(self.direct_lightmap.memory());
        memory.extend(self.volume.iter().flat_map(GpuVolume::memory));
        memory.extend(self.direct_pass.iter().flat_map(DirectPass::memory));
        memory.push(("light map", texture(&self.light_map.texture)));
        memory.push(("irradiance map", texture(&self.maps.irradiance)));
        memory.push(("radiance map", texture(&self.maps.radiance)));
        memory
    }
}
