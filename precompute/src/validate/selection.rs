//! Which receivers are measured, and how what was measured is shown at all of them.

use super::subject::Subject;
use crate::probes::point_grid::PointGrid;
use glam::Vec3;
use localprt_formats::directions::counter_uniform;
use rayon::prelude::*;

/// Receivers to measure, in file order: all of them, or `wanted` that are spread evenly over the file, in which
/// neighbors in space follow each other. One is drawn at random from each run of `n / wanted`.
pub fn sample(n_receivers: usize, wanted: usize, seed: u64) -> Vec<u32> {
    if wanted >= n_receivers {
        return (0..n_receivers as u32).collect();
    }
    let run = n_receivers as f64 / wanted as f64;
    let mut chosen: Vec<u32> = (0..wanted)
        .map(|index| {
            let place = (index as f64 + counter_uniform(seed, 0x5a3, index as u64)) * run;
            (place as usize).min(n_receivers - 1) as u32
        })
        .collect();
    chosen.dedup();
    chosen
}

/// At most `most` of a list, spread evenly.
pub fn thin<T: Copy>(all: &[T], most: usize) -> Vec<T> {
    let count = all.len().min(most);
    (0..count).map(|index| all[index * all.len() / count]).collect()
}

/// Pairs of receivers across which light should not step.
#[derive(Clone, Debug, Default)]
pub struct Pairs {
    /// On both sides of a chart seam, at the same place.
    pub charts: Vec<[u32; 2]>,
    /// Neighbors in one chart that belong to different clusters.
    pub clusters: Vec<[u32; 2]>,
    /// Neighbors in one chart and cluster, to compare with.
    pub within: Vec<[u32; 2]>,
}

impl Pairs {
    /// At most `most` of each kind.
    pub fn of(subject: &Subject<'_>, most: usize) -> Self {
        let size = subject.view.metadata.lightmap_size;
        let mut across = Vec::new();
        let mut within = Vec::new();
        for (receiver, &texel) in subject.view.receiver_texel.iter().enumerate() {
            let (x, y) = (texel % size, texel / size);
            for (x, y) in [(x + 1, y), (x, y + 1)] {
                if x >= size || y >= size {
                    continue;
                }
                let receiver = receiver as u32;
                let other = subject.at_texel[(y * size + x) as usize];
                if other == u32::MAX || subject.chart(receiver) != subject.chart(other) {
                    continue;
                }
                let clusters = [receiver, other].map(|receiver| subject.cluster[receiver as usize]);
                if clusters[0] == clusters[1] { &mut within } else { &mut across }.push([receiver, other]);
            }
        }
        Self { charts: thin(subject.view.seams, most), clusters: thin(&across, most), within: thin(&within, most) }
    }

    /// All receivers of all pairs.
    pub fn receivers(&self) -> impl Iterator<Item = u32> + '_ {
        self.charts.iter().chain(&self.clusters).chain(&self.within).flatten().copied()
    }
}

/// Values at `[n_receivers]` from those at the measured ones: each its own, any other a mean of measured ones around it
/// that face the same way, nearer ones first.
pub fn spread(subject: &Subject<'_>, measured: &[u32], values: &[Vec3]) -> Vec<Vec3> {
    assert_eq!(measured.len(), values.len(), "a value for every measured receiver");
    let mut all = vec![Vec3::NAN; subject.len()];
    for (&receiver, &value) in measured.iter().zip(values) {
        all[receiver as usize] = value;
    }
    if measured.is_empty() || measured.len() == subject.len() {
        return all;
    }
    let points: Vec<Vec3> = measured.iter().map(|&receiver| subject.point(receiver).position).collect();
    let extent = subject.caster.scene().extent();
    let grid = PointGrid::new(&points, extent / (points.len() as f32).sqrt());
    let found: Vec<Vec3> = (0..subject.len() as u32)
        .into_par_iter()
        .map(|receiver| {
            let own = all[receiver as usize];
            if !own.is_nan() {
                return own;
            }
            let point = subject.point(receiver);
            let mut radius = 0.5 * extent / (points.len() as f32).sqrt();
            for _ in 0..16 {
                let (mut sum, mut total) = (Vec3::ZERO, 0.0);
                grid.for_each_within(point.position, radius, |id, distance| {
                    let facing = point.normal.dot(subject.point(measured[id as usize]).normal).max(0.0).powi(4);
                    let near = 1.0 - distance / radius;
                    let weight = facing * near * near / (distance + 1e-3 * radius);
                    sum += weight * values[id as usize];
                    total += weight;
                });
                if total > 0.0 {
                    return sum / total;
                }
                radius *= 2.0;
            }
            // Nothing measured faces the same way.
            Vec3::ZERO
        })
        .collect();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_even_and_in_order() {
        let chosen = sample(10_000, 100, 7);
        assert_eq!(chosen.len(), 100);
        for (run, receiver) in chosen.iter().enumerate() {
            assert_eq!(*receiver as usize / 100, run);
        }
        assert_eq!(sample(5, 9, 0), [0, 1, 2, 3, 4]);
        assert_ne!(sample(10_000, 100, 8), chosen);
        assert!(sample(0, 4, 0).is_empty());
    }

    #[test]
    fn thinning_keeps_both_ends_of_the_list_apart() {
        let all: Vec<u32> = (0..1000).collect();
        assert_eq!(thin(&all, 4), [0, 250, 500, 750]);
        assert_eq!(thin(&all[..3], 4), [0, 1, 2]);
        assert!(thin(&all[..0], 4).is_empty());
    }
}
