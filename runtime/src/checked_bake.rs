//! A baked file whose counts, ranges and indices have been checked once, so that the passes can trust them.

use crate::checked_volume::CheckedVolume;
use crate::error::RelightError;
use half::f16;
use localprt_formats::check::check_near;
use localprt_formats::sh::{self, MAX_DEGREE};
use localprt_formats::{BakedView, ClusterRecord, LEVEL_SKY, MAX_LEVEL, NearView, VolumeView};
use rayon::prelude::*;
use std::ops::Range;

/// Widest map that is relit, texels per side: 2^14, twice the widest texture that WebGPU guarantees.
pub const MAX_MAP_SIZE: u32 = 1 << 14;
/// Highest receiver degree with a conversion to irradiance.
pub const MAX_RECEIVER_DEGREE: u32 = 1;

/// A baked file with checked structure: what every pass reads.
#[derive(Clone, Debug)]
pub struct CheckedBake<'a> {
    view: BakedView<'a>,
    transport: Transport<'a>,
    volume: Option<CheckedVolume<'a>>,
    /// `[n_receivers]` for degree 1, else empty.
    cosine_weights: Vec<[f32; 4]>,
}

impl<'a> CheckedBake<'a> {
    /// Checks lengths, ranges and indices; not the values of the matrices, which `Baked::open` looks at.
    ///
    /// # Errors
    /// [`RelightError::Bake`] names the first array or cluster that does not fit.
    pub fn new(view: BakedView<'a>) -> Result<Self, RelightError> {
        let meta = view.metadata;
        for (name, degree, highest) in [
            ("probe_degree", meta.probe_degree, MAX_DEGREE),
            ("sky_degree", meta.sky_degree, MAX_DEGREE),
            ("receiver_degree", meta.receiver_degree, MAX_RECEIVER_DEGREE),
        ] {
            ensure(degree <= highest, "metadata", || format!("{name} is {degree}, at most {highest} can be relit"))?;
        }
        for (name, size) in [("lightmap_size", meta.lightmap_size), ("direct_size", meta.direct_size)] {
            ensure((1..=MAX_MAP_SIZE).contains(&size), "metadata", || {
                format!("{name} is {size}, must lie in 1..={MAX_MAP_SIZE}")
            })?;
        }
        check_rays(&view)?;
        check_receivers(&view)?;
        let transport = Transport::of_lightmap(&view)?;
        let volume = view.volume.map(|volume| CheckedVolume::new(&view, volume)).transpose()?;
        check_near(&view).or_else(|violation| fail("near light", violation.message))?;
        let mut checked = Self { view, transport, volume, cosine_weights: Vec::new() };
        if meta.receiver_degree == 1 {
            checked.cosine_weights =
                view.receiver_normal.par_iter().map(|&normal| sh::irradiance_weights_degree_1(normal)).collect();
        }
        Ok(checked)
    }

    /// The arrays of the file.
    pub fn view(&self) -> &BakedView<'a> {
        &self.view
    }

    /// SH functions per probe.
    pub fn n_sh(&self) -> usize {
        self.transport.n_sh
    }

    /// Outputs per receiver: 1 for irradiance, 4 for SH radiance of degree 1.
    pub fn n_k(&self) -> usize {
        self.transport.n_k
    }

    /// Number of probes.
    pub fn n_probes(&self) -> usize {
        self.view.probes.len()
    }

    /// Relight rays per probe.
    pub fn n_rays(&self) -> usize {
        self.view.metadata.n_rays as usize
    }

    /// Number of receivers.
    pub fn n_receivers(&self) -> usize {
        self.view.receiver_texel.len()
    }

    /// Cluster lights of all clusters.
    pub fn n_cluster_lights(&self) -> usize {
        self.transport.n_cluster_lights
    }

    /// `[n_probes, n_rays]` metres that relight rays go; empty if the file does not say.
    pub fn ray_distance(&self) -> &'a [f16] {
        self.view.ray_distance
    }

    /// Transport from probes and sky to the receivers of the lightmap.
    pub fn transport(&self) -> &Transport<'a> {
        &self.transport
    }

    /// Grid in the open space, for objects that move, and transport to its cells; `None` if the file has none.
    pub fn volume(&self) -> Option<&CheckedVolume<'a>> {
        self.volume.as_ref()
    }

    /// What receivers read from the light map beside their probes; `None` if the file has no near light.
    pub fn near(&self) -> Option<&NearView<'a>> {
        self.view.near.as_ref()
    }

    pub(crate) fn cosine_weights(&self) -> &[[f32; 4]] {
        &self.cosine_weights
    }
}

fn check_rays(view: &BakedView<'_>) -> Result<(), RelightError> {
    let (n_rays, n_probes) = (view.metadata.n_rays as usize, view.probes.len());
    check_len("ray_dirs", view.ray_dirs.len(), Some(n_rays))?;
    check_len("ray_sh", view.ray_sh.len(), n_rays.checked_mul(view.metadata.n_sh()))?;
    check_len("ray_uv", view.ray_uv.len(), n_probes.checked_mul(n_rays))?;
    check_len("ray_level", view.ray_level.len(), n_probes.checked_mul(n_rays))?;
    if !view.ray_distance.is_empty() {
        check_len("ray_distance", view.ray_distance.len(), n_probes.checked_mul(n_rays))?;
    }
    let is_unknown = |level: &u8| (MAX_LEVEL + 1..LEVEL_SKY).contains(level);
    match view.ray_level.par_iter().position_first(is_unknown) {
        None => Ok(()),
        Some(ray) => fail("ray_level", format!("entry {ray} is {}, levels end at {MAX_LEVEL}", view.ray_level[ray])),
    }
}

fn check_receivers(view: &BakedView<'_>) -> Result<(), RelightError> {
    let n_receivers = view.receiver_texel.len();
    check_len("receiver_normal", view.receiver_normal.len(), Some(n_receivers))?;
    let n_texels = u64::from(view.metadata.lightmap_size).pow(2);
    let texels = view.receiver_texel.iter().chain(view.gutters.iter().map(|[texel, _]| texel));
    if let Some(texel) = texels.copied().find(|&texel| u64::from(texel) >= n_texels) {
        return fail("receiver_texel and gutters", format!("texel {texel} lies outside of {n_texels} texels"));
    }
    match view.gutters.iter().find(|[_, receiver]| *receiver as usize >= n_receivers) {
        None => Ok(()),
        Some([_, receiver]) => fail("gutters", format!("receiver {receiver} does not exist, there are {n_receivers}")),
    }
}

/// Compressed transport from probes and sky to one set of receivers; ranges and indices checked.
#[derive(Clone, Copy, Debug)]
pub struct Transport<'a> {
    /// `[n_clusters]`.
    pub clusters: &'a [ClusterRecord],
    /// Supporting probes of all clusters, cluster by cluster.
    pub cluster_probes: &'a [u32],
    /// `S V^T` of all clusters.
    pub projection: &'a [f16],
    /// `U` of all clusters.
    pub reconstruction: &'a [f16],
    /// Number of probes.
    pub n_probes: usize,
    /// SH functions per probe.
    pub n_sh: usize,
    /// SH functions of the sky.
    pub n_sky: usize,
    /// Outputs per receiver.
    pub n_k: usize,
    /// Number of receivers.
    pub n_receivers: usize,
    /// Cluster lights of all clusters.
    pub n_cluster_lights: usize,
}

impl<'a> Transport<'a> {
    fn of_lightmap(view: &BakedView<'a>) -> Result<Self, RelightError> {
        Self {
            clusters: view.clusters,
            cluster_probes: view.cluster_probes,
            projection: view.projection,
            reconstruction: view.reconstruction,
            n_probes: view.probes.len(),
            n_sh: view.metadata.n_sh(),
            n_sky: view.metadata.n_sky(),
            n_k: view.metadata.n_k(),
            n_receivers: view.receiver_texel.len(),
            n_cluster_lights: 0,
        }
        .checked("")
    }

    /// That of a volume whose grid has been checked.
    pub(crate) fn of_volume(view: &BakedView<'a>, volume: &VolumeView<'a>) -> Result<Self, RelightError> {
        Self {
            clusters: volume.clusters,
            cluster_probes: volume.cluster_probes,
            projection: volume.projection,
            reconstruction: volume.reconstruction,
            n_probes: view.probes.len(),
            n_sh: view.metadata.n_sh(),
            n_sky: view.metadata.n_sky(),
            n_k: volume.grid.n_k(),
            n_receivers: volume.cells.len(),
            n_cluster_lights: 0,
        }
        .checked("volume ")
    }

    /// With the number of cluster lights; `of` precedes the names in messages.
    fn checked(self, of: &str) -> Result<Self, RelightError> {
        Ok(Self { n_cluster_lights: self.check(of)?, ..self })
    }

    /// Receivers of a cluster.
    pub fn receiver_range(&self, cluster: usize) -> Range<usize> {
        let record = &self.clusters[cluster];
        range(record.first_receiver, record.n_receivers as usize)
    }

    /// Lights of a cluster among all cluster lights.
    pub fn light_range(&self, cluster: usize) -> Range<usize> {
        let record = &self.clusters[cluster];
        range(record.first_light, record.n_coefficients as usize)
    }

    /// Values of a cluster's `S V^T` in `projection`, without padding.
    pub fn projection_range(&self, cluster: usize) -> Range<usize> {
        let record = &self.clusters[cluster];
        let start = 2 * record.projection_pair as usize;
        start..start + projection_len(record, self.n_sh) as usize
    }

    /// Values of a cluster's `U` in `reconstruction`, without padding.
    pub fn reconstruction_range(&self, cluster: usize) -> Range<usize> {
        let record = &self.clusters[cluster];
        let start = 2 * record.reconstruction_pair as usize;
        start..start + reconstruction_len(record, self.n_k) as usize
    }

    /// Returns the number of cluster lights.
    fn check(&self, of: &str) -> Result<usize, RelightError> {
        let (mut n_lights, mut receiver_end) = (0u64, 0u64);
        for (cluster, record) in self.clusters.iter().enumerate() {
            let place = format!("{of}cluster {cluster}");
            let receivers = (u64::from(record.first_receiver), u64::from(record.n_receivers));
            ensure(receivers.1 > 0, &place, || "has no receiver".into())?;
            ensure(receivers.0 >= receiver_end, &place, || {
                format!("starts at receiver {}, the cluster before ends at {receiver_end}", receivers.0)
            })?;
            receiver_end = receivers.0 + receivers.1;
            check_end(&place, "receivers", receiver_end, self.n_receivers)?;
            let probe_end = u64::from(record.first_probe) + u64::from(record.n_probes);
            check_end(&place, "probe list", probe_end, self.cluster_probes.len())?;
            let sky_is_known = record.n_sky == 0 || record.n_sky as usize == self.n_sky;
            ensure(sky_is_known, &place, || {
                format!("has {} sky columns, allowed are 0 and {}", record.n_sky, self.n_sky)
            })?;
            ensure(u64::from(record.first_light) == n_lights, &place, || {
                format!("first light is {}, the clusters before have {n_lights}", record.first_light)
            })?;
            n_lights += u64::from(record.n_coefficients);
            let projection_end = 2 * u64::from(record.projection_pair) + projection_len(record, self.n_sh);
            check_end(&place, "projection", projection_end, self.projection.len())?;
            let reconstruction_end = 2 * u64::from(record.reconstruction_pair) + reconstruction_len(record, self.n_k);
            check_end(&place, "reconstruction", reconstruction_end, self.reconstruction.len())?;
        }
        match self.cluster_probes.iter().find(|&&probe| probe as usize >= self.n_probes) {
            None => Ok(n_lights as usize),
            Some(probe) => {
                let problem = format!("probe {probe} does not exist, there are {}", self.n_probes);
                fail(&format!("{of}cluster_probes"), problem)
            }
        }
    }
}

/// Saturates: no array is that long, so the range check refuses it.
fn projection_len(record: &ClusterRecord, n_sh: usize) -> u64 {
    let n_columns = u64::from(record.n_probes) * n_sh as u64 + u64::from(record.n_sky);
    n_columns.saturating_mul(u64::from(record.n_coefficients)).min(u64::MAX / 4)
}

fn reconstruction_len(record: &ClusterRecord, n_k: usize) -> u64 {
    let n_rows = u64::from(record.n_receivers) * n_k as u64;
    n_rows.saturating_mul(u64::from(record.n_coefficients)).min(u64::MAX / 4)
}

fn range(first: u32, len: usize) -> Range<usize> {
    first as usize..first as usize + len
}

fn check_len(array: &str, found: usize, expected: Option<usize>) -> Result<(), RelightError> {
    ensure(expected == Some(found), array, || match expected {
        Some(expected) => format!("has {found} entries, needs {expected}"),
        None => format!("has {found} entries, needs more than fit in memory"),
    })
}

fn check_end(place: &str, what: &str, end: u64, present: usize) -> Result<(), RelightError> {
    ensure(end <= present as u64, place, || format!("{what} ends at entry {end}, there are {present}"))
}

pub(crate) fn ensure(holds: bool, place: &str, problem: impl FnOnce() -> String) -> Result<(), RelightError> {
    if holds { Ok(()) } else { fail(place, problem()) }
}

pub(crate) fn fail<T>(place: &str, problem: String) -> Result<T, RelightError> {
    Err(RelightError::Bake { place: place.into(), problem })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_bake;
    use localprt_formats::BakedArrays;

    #[track_caller]
    fn assert_refused(expected_place: &str, change: impl FnOnce(&mut BakedArrays)) {
        let mut arrays = test_bake::furnace(1);
        assert!(CheckedBake::new(arrays.view()).is_ok());
        change(&mut arrays);
        match CheckedBake::new(arrays.view()) {
            Err(RelightError::Bake { place, problem }) => {
                assert!(place.contains(expected_place), "{place}: {problem}");
            }
            other => panic!("{expected_place}: {other:?}"),
        }
    }

    #[test]
    fn contradicting_arrays_are_refused_by_name() {
        assert_refused("metadata", |a| a.metadata.probe_degree = u32::MAX);
        assert_refused("metadata", |a| a.metadata.receiver_degree = 2);
        assert_refused("metadata", |a| a.metadata.sky_degree = 11);
        assert_refused("metadata", |a| a.metadata.lightmap_size = 0);
        assert_refused("metadata", |a| a.metadata.direct_size = u32::MAX);
        assert_refused("ray_dirs", |a| a.metadata.n_rays += 1);
        assert_refused("ray_sh", |a| a.ray_sh.truncate(7));
        assert_refused("ray_uv", |a| a.ray_uv.push(0));
        assert_refused("ray_level", |a| a.ray_level.clear());
        assert_refused("ray_level", |a| a.ray_level[3] = 16);
        assert_refused("ray_distance", |a| a.ray_distance.push(f16::ONE));
        assert_refused("receiver_normal", |a| a.receiver_normal.clear());
        assert_refused("receiver_texel", |a| a.receiver_texel[0] = 16);
        assert_refused("gutters", |a| a.gutters.push([0, u32::MAX]));
        assert_refused("receiver_texel and gutters", |a| a.gutters.push([u32::MAX, 0]));
        assert_refused("cluster_probes", |a| a.cluster_probes[0] = 2);
    }

    #[test]
    fn clusters_outside_of_their_arrays_are_refused() {
        for change in [
            (|record| record.n_receivers = 0) as fn(&mut ClusterRecord),
            |record| record.n_receivers = u32::MAX,
            |record| record.first_receiver = 1,
            |record| record.n_probes = u32::MAX,
            |record| record.first_probe = 3,
            |record| record.n_sky = 5,
            |record| record.n_coefficients = u32::MAX,
            |record| record.first_light = 1,
            |record| record.projection_pair = u32::MAX,
            |record| record.reconstruction_pair = u32::MAX,
        ] {
            assert_refused("cluster 0", |a| change(&mut a.clusters[0]));
        }
        assert_refused("cluster 1", |a| a.clusters.push(a.clusters[0]));
    }

    #[test]
    fn a_file_without_receivers_is_fine() {
        let arrays = BakedArrays::default();
        // Sizes of zero are not.
        assert!(CheckedBake::new(arrays.view()).is_err());
        let mut arrays = arrays;
        arrays.metadata.lightmap_size = 1;
        arrays.metadata.direct_size = 1;
        assert!(CheckedBake::new(arrays.view()).is_ok());
    }
}
