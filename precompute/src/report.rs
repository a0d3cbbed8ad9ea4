//! The report of a bake: what was made, how good it is, what it cost.
//!
//! `precompute bake --report` writes it as JSON; a copy without anything that changes from run to run lies in the baked
//! file.

pub use localprt_tools::progress::StageTime;

use crate::{progress::Progress, settings::BakeSettings};
use localprt_formats::{BakedView, TransportBytes};
use localprt_tools::memory::peak_rss_bytes;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Everything worth knowing about a bake. Fields up to `threads` are the documented ones, in their order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct BakeReport {
    /// The input.
    pub scene: SceneFacts,
    /// Options as they were in force.
    pub options: BakeSettings,
    /// Receivers in the file.
    pub receivers: u64,
    /// Covered texels without receiver: every sample point lies inside or behind geometry.
    pub invalid_receivers: u64,
    /// Radiance probes.
    pub probes: u64,
    /// Support radius of the probes, metres.
    pub radius: f32,
    /// Supporting probes per receiver.
    pub overlap: Overlap,
    /// Clusters.
    pub clusters: u64,
    /// Mean over receivers of the kept singular values of their cluster.
    pub coefficients_per_receiver: f64,
    /// Mean over clusters of their supporting probes.
    pub probes_per_cluster: f64,
    /// Rays traced by the bake.
    pub rays: u64,
    /// Cosine-weighted share of directions whose surface neither a supporting probe sees nor a link reads, over receivers.
    pub unseen: Unseen,
    /// What compression changed.
    pub compression: Compression,
    /// Sizes.
    pub bytes: Bytes,
    /// Wall time by stage.
    pub stages: Vec<StageTime>,
    /// Wall time in all.
    pub seconds: f64,
    /// Largest resident size of the process; 0 where the system does not say.
    pub peak_rss_bytes: u64,
    /// Threads of the bake.
    pub threads: u64,
    /// Leaves of the transport; absent without a cache.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cache: Option<CacheUse>,
    /// How the scene got its layout.
    pub atlas: AtlasFacts,
    /// How the probes were placed.
    pub placement: PlacementFacts,
    /// Places of the light map that receivers read beside their probes.
    pub links: LinkFacts,
    /// Receiver pairs on both sides of a chart seam.
    pub seams: u64,
    /// Closest-hit rays of the receivers, and those that only look for the sky.
    pub gather_rays: u64,
    /// Visibility rays between surface points and probes.
    pub visibility_rays: u64,
    /// What the relight rays of all probes met.
    pub relight: RelightFacts,
    /// Where receivers, texels and probes went.
    pub budget: BudgetFacts,
    /// The volume; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<VolumeFacts>,
    /// What the user was warned of.
    pub warnings: Vec<String>,
}

/// The input of a bake.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SceneFacts {
    /// After dropping unusable ones.
    pub triangles: u64,
    /// Materials.
    pub materials: u64,
    /// BLAKE3 of the scene and its files, in hex.
    pub hash: String,
    /// Triangles left out: no area.
    pub degenerate: u64,
    /// Triangles left out: repeated.
    pub duplicate: u64,
}

/// Where the leaves of a bake came from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct CacheUse {
    /// From the cache.
    pub reused: u64,
    /// Made.
    pub baked: u64,
}

impl std::ops::AddAssign for CacheUse {
    fn add_assign(&mut self, other: Self) {
        self.reused += other.reused;
        self.baked += other.baked;
    }
}

/// Supporting probes per receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Overlap {
    /// Over all receivers.
    pub mean: f32,
    /// Fewest.
    pub min: u32,
    /// Most.
    pub max: u32,
}

/// Shares over all receivers, 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Unseen {
    /// Arithmetic mean.
    pub mean: f64,
    /// 95 % of the receivers have at most this.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl Unseen {
    /// Of `[n_receivers]` shares; zeros without receivers.
    pub fn of(shares: &[f32]) -> Self {
        let mut sorted = shares.to_vec();
        sorted.sort_unstable_by(f32::total_cmp);
        let Some(&max) = sorted.last() else { return Self::default() };
        let mean = shares.iter().map(|&share| f64::from(share)).sum::<f64>() / shares.len() as f64;
        // Nearest rank: the smallest value that at least 95 % do not exceed.
        let rank = (sorted.len() * 95).div_ceil(100);
        Self { mean, p95: sorted[rank - 1].into(), max: max.into() }
    }
}

/// RMS over the transport row of one receiver of what truncation and storage changed; of fitted rows, of what that does to
/// irradiance in the light that the fit expects, as a share of what is usual there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Compression {
    /// Over all receivers.
    pub rms_error: f64,
    /// Of the worst row of all receivers.
    pub max_error: f64,
}

/// Places of the light map that a receiver reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LinkFacts {
    /// Over all receivers.
    pub mean: f64,
    /// Most.
    pub max: u32,
}

impl LinkFacts {
    /// Of the links of each receiver, over all; `counts` may leave out those without.
    pub fn of(counts: impl Iterator<Item = u8>, n_receivers: usize) -> Self {
        let (sum, max) = counts.fold((0, 0), |(sum, max), count| (sum + u64::from(count), count.max(max)));
        Self { mean: sum as f64 / n_receivers.max(1) as f64, max: max.into() }
    }
}

/// Sizes in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Bytes {
    /// `S V^T` of all clusters.
    pub projection: u64,
    /// `U` of all clusters.
    pub reconstruction: u64,
    /// Relight rays: directions, basis, lookups, distances.
    pub relight: u64,
    /// The whole file.
    pub file: u64,
    /// Near light: tiles, nodes, links and weights.
    pub near_light: u64,
}

impl Bytes {
    /// Of the arrays of a file; that of the whole file is left at 0.
    pub fn of(view: &BakedView<'_>) -> Self {
        let TransportBytes { projection, reconstruction, relight, near_light } = view.transport_bytes();
        Self { projection, reconstruction, relight, near_light, file: 0 }
    }
}

/// How the scene got its lightmap coordinates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct AtlasFacts {
    /// They are made by the bake; the scene's own were kept otherwise.
    pub unwrapped: bool,
    /// Why, if the scene had some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Receiver map, texels per side.
    pub lightmap: u32,
    /// Direct light map, texels per side.
    pub direct_map: u32,
    /// Charts.
    pub charts: u64,
    /// Faces added for the back sides of double-sided surfaces.
    pub back_faces: u64,
    /// Receiver texels that a face covers.
    pub covered_texels: u64,
    /// Receivers moved out of the way of near geometry.
    pub pushed_receivers: u64,
}

/// How the probes were placed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PlacementFacts {
    /// Probe spacing in force, metres.
    pub spacing: f32,
    /// Voxel size in force, metres.
    pub voxel: f32,
    /// Candidates before thinning.
    pub candidates: u64,
    /// Candidates rejected for back faces or clearance.
    pub rejected: u64,
    /// Probes added by the coverage repair.
    pub repaired: u64,
}

/// Where receivers, texels and probes went.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct BudgetFacts {
    /// Receivers asked for.
    pub receivers_asked: u32,
    /// Edges of the texels of the receiver map.
    pub texel: TexelFacts,
    /// Share of the receiver map that faces touch.
    pub map_used: f64,
    /// Texels of the direct light map for each receiver.
    pub texels_per_receiver: f64,
    /// The scene's cameras.
    pub views: Vec<ViewFacts>,
}

/// Edges of texels on the surface, over receivers, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TexelFacts {
    /// Smallest.
    pub finest: f32,
    /// Median.
    pub median: f32,
    /// Largest.
    pub coarsest: f32,
}

/// What a camera of the scene sees.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ViewFacts {
    /// Name of the camera.
    pub name: String,
    /// Median over its picture of the edge of the texels seen, metres.
    pub texel_median: f32,
    /// Receivers that it sees.
    pub receivers: u64,
    /// Probes that it sees.
    pub probes: u64,
    /// Share of its picture whose texels are larger than 1/30 of their distance.
    pub coarse: f64,
    /// Mean unseen share of the receivers that it sees.
    pub unseen: f64,
    /// Share of all receivers that are no farther from it than nine tenths of what it sees around it.
    pub reach: f64,
}

/// The volume for objects that move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct VolumeFacts {
    /// Cells per axis.
    pub dims: [u32; 3],
    /// Cells in the open, with light of their own.
    pub receivers: u64,
    /// Cells inside or behind geometry.
    pub invalid: u64,
    /// Of those, cells that take the values of one in the open.
    pub filled: u64,
    /// Clusters.
    pub clusters: u64,
    /// Bytes of its sections.
    pub bytes: u64,
}

impl VolumeFacts {
    /// Of the arrays in a file.
    pub fn of(volume: &localprt_formats::VolumeView<'_>) -> Self {
        let receivers = volume.cells.len() as u64;
        Self {
            dims: volume.grid.dims,
            receivers,
            invalid: volume.grid.n_cells() - receivers,
            filled: volume.fill.len() as u64,
            clusters: volume.blocks.total(|block| block.n_clusters),
            bytes: (size_of_val(volume.grid) + size_of_val(volume.cells) + size_of_val(volume.fill)) as u64
                + volume.blocks.byte_count(volume.grid.n_k()),
        }
    }
}

/// Relight rays by what they met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RelightFacts {
    /// A face with lightmap texels.
    pub surface: u64,
    /// Of those, rays that read the nearest texel of their chart because their own place has none.
    pub moved: u64,
    /// Nothing: they read the sky.
    pub sky: u64,
    /// The black back of a one-sided surface.
    pub black: u64,
    /// A face without texels near by: black.
    pub unmapped: u64,
}

impl BakeReport {
    /// Takes in the sizes of the arrays of a file.
    pub fn count_bytes(&mut self, view: &BakedView<'_>) {
        self.bytes = Bytes::of(view);
        self.volume = view.volume.map(|volume| VolumeFacts::of(&volume));
    }

    /// Takes in what the run took so far.
    pub fn measure_run(&mut self, progress: &Progress) {
        self.stages = progress.stages();
        self.seconds = progress.seconds();
        self.peak_rss_bytes = peak_rss_bytes("self").unwrap_or(0);
        self.threads = rayon::current_num_threads() as u64;
    }

    /// The report as `--report` writes it.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// The copy for the baked file: the same for the same input and options on any machine and thread count, so without
    /// times, memory, threads and the size of the file it is part of.
    pub fn to_embedded_json(&self) -> String {
        // By way of the text, in which f32 values keep their short form.
        let mut value: Value = serde_json::from_str(&self.to_json()).unwrap_or_default();
        if let Some(fields) = value.as_object_mut() {
            for name in ["stages", "seconds", "peak_rss_bytes", "threads", "cache"] {
                fields.shift_remove(name);
            }
            if let Some(bytes) = fields.get_mut("bytes").and_then(Value::as_object_mut) {
                bytes.shift_remove("file");
            }
        }
        value.to_string()
    }
}

/// Median, the upper of two; 0 of nothing.
pub fn median(values: impl IntoIterator<Item = f32>) -> f32 {
    let mut sorted: Vec<f32> = values.into_iter().collect();
    sorted.sort_unstable_by(f32::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(value: &Value) -> Vec<&str> {
        value.as_object().expect("an object").keys().map(String::as_str).collect()
    }

    #[test]
    fn documented_fields_come_first_and_in_their_order() {
        let report = BakeReport { stages: vec![StageTime::default()], ..BakeReport::default() };
        let json: Value = serde_json::from_str(&report.to_json()).expect("JSON");
        let documented = "scene options receivers invalid_receivers probes radius overlap clusters \
            coefficients_per_receiver probes_per_cluster rays unseen compression bytes stages seconds peak_rss_bytes \
            threads";
        assert_eq!(keys(&json)[..18].join(" "), documented);
        assert_eq!(keys(&json["scene"])[..3].join(" "), "triangles materials hash");
        assert_eq!(keys(&json["overlap"]).join(" "), "mean min max");
        assert_eq!(keys(&json["unseen"]).join(" "), "mean p95 max");
        assert_eq!(keys(&json["compression"]).join(" "), "rms_error max_error");
        assert_eq!(keys(&json["bytes"]).join(" "), "projection reconstruction relight file near_light");
        assert_eq!(keys(&json["stages"][0]).join(" "), "name seconds peak_rss_bytes");
        assert_eq!(serde_json::from_value::<BakeReport>(json).expect("a report"), report);
    }

    #[test]
    fn the_embedded_copy_does_not_change_from_run_to_run() {
        let first = BakeReport { seconds: 1.0, threads: 1, peak_rss_bytes: 5, receivers: 9, ..BakeReport::default() };
        let stages = vec![StageTime { name: "unwrap".into(), seconds: 3.0, peak_rss_bytes: 4 }];
        let bytes = Bytes { file: 7, ..first.bytes };
        let second = BakeReport { seconds: 2.0, threads: 8, peak_rss_bytes: 6, stages, bytes, ..first.clone() };
        assert_eq!(first.to_embedded_json(), second.to_embedded_json());
        assert!(first.to_embedded_json().contains("\"threshold\":0.005,"));
        let other = BakeReport { receivers: 10, ..first.clone() };
        assert_ne!(first.to_embedded_json(), other.to_embedded_json());
    }

    #[test]
    fn shares_are_summed_up_by_nearest_rank() {
        let shares: Vec<f32> = (1..=100).rev().map(|share| share as f32 / 100.0).collect();
        let unseen = Unseen::of(&shares);
        // f32 shares: each within 2^-24 of its decimal.
        assert!((unseen.mean - 0.505).abs() < 1e-7);
        assert_eq!((unseen.p95, unseen.max), (f64::from(0.95f32), 1.0));
        assert_eq!(Unseen::of(&[0.5]), Unseen { mean: 0.5, p95: 0.5, max: 0.5 });
        assert_eq!(Unseen::of(&[]), Unseen::default());
    }
}
