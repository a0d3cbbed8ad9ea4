//! Adaptive refinement of a leaf: split along the main direction of transport space until the kept singular values hold
//! the error threshold.
//!
//! The paper leaves the split rule open. Ours: receivers are ordered by their coordinate along the first principal
//! direction of the cluster's rows about their mean, and cut at the median. Splits end at the threshold, or where a
//! cluster has too few rows to split.

use super::Cluster;
use crate::{
    compress::{
        CompressedRows, compress, least_rank,
        svd::{TruncatedSvd, truncated_svd},
    },
    transport::TransportRows,
};

/// When a cluster is good enough.
#[derive(Clone, Copy, Debug)]
pub struct RefineSettings {
    /// Largest RMS error per row.
    pub threshold: f64,
    /// Most singular values.
    pub max_coefficients: usize,
    /// Columns per probe.
    pub n_sh: usize,
    /// Sky columns.
    pub n_sky: usize,
}

/// A cluster under way: rows of some members of a leaf, without the columns that none of them uses.
struct Part {
    members: Vec<u32>,
    unseen: Vec<f32>,
    probes: Vec<u32>,
    n_sky: usize,
    n_columns: usize,
    rows: Vec<f32>,
}

/// Compresses the rows of `members`; the clusters cover the members once, in splitting order.
pub fn refine(members: &[u32], rows: TransportRows, settings: &RefineSettings) -> Vec<Cluster> {
    let n_k = rows.n_k;
    let whole = Part {
        members: members.to_vec(),
        unseen: rows.unseen,
        probes: rows.probes,
        n_sky: settings.n_sky,
        n_columns: rows.n_columns,
        rows: rows.rows,
    };
    let mut finished = Vec::new();
    let mut open = vec![whole.without_empty_columns(settings)];
    while let Some(part) = open.pop() {
        let n_rows = part.members.len() * n_k;
        if part.n_columns == 0 {
            // Nobody here sees anything.
            let rows = CompressedRows { row_error_squared: vec![0.0; n_rows], ..CompressedRows::default() };
            finished.push(part.into_cluster(rows));
            continue;
        }
        let svd = truncated_svd(&part.rows, n_rows, part.n_columns, settings.max_coefficients.min(n_rows));
        let allowed_squared = settings.threshold * settings.threshold * n_rows as f64;
        if let Some(cluster) = part.finish(&svd, allowed_squared, settings) {
            finished.push(cluster);
        } else if part.members.len() == 1 {
            // One receiver has at most n_k rows, so only f16 rounding can keep it above the threshold: keep them all.
            let rows = compress(&part.rows, &svd, svd.rank);
            finished.push(part.into_cluster(rows));
        } else {
            let [lower, upper] = part.split(&svd, n_k, settings);
            open.push(upper);
            open.push(lower);
        }
    }
    finished
}

impl Part {
    /// The compressed cluster, if the threshold holds after rounding to f16.
    fn finish(&self, svd: &TruncatedSvd, allowed_squared: f64, settings: &RefineSettings) -> Option<Cluster> {
        let mut n_c = least_rank(svd, allowed_squared)?;
        while n_c <= svd.rank.min(settings.max_coefficients) {
            let rows = compress(&self.rows, svd, n_c);
            if rows.row_error_squared.iter().sum::<f64>() <= allowed_squared {
                return Some(self.cluster(rows));
            }
            n_c += 1;
        }
        None
    }

    fn cluster(&self, rows: CompressedRows) -> Cluster {
        Cluster {
            members: self.members.clone(),
            probes: self.probes.clone(),
            n_sky: self.n_sky,
            unseen: self.unseen.clone(),
            rows,
        }
    }

    fn into_cluster(self, rows: CompressedRows) -> Cluster {
        self.cluster(rows)
    }

    /// Two halves by the first principal coordinate about the mean.
    fn split(self, svd: &TruncatedSvd, n_k: usize, settings: &RefineSettings) -> [Self; 2] {
        let n_members = self.members.len();
        let scores = principal_scores(svd, n_members, n_k);
        let mut order: Vec<usize> = (0..n_members).collect();
        order.sort_by(|&a, &b| scores[a].total_cmp(&scores[b]).then(self.members[a].cmp(&self.members[b])));
        let (lower, upper) = order.split_at(n_members / 2);
        [lower, upper].map(|half| {
            let mut half = half.to_vec();
            half.sort_unstable();
            let row_length = n_k * self.n_columns;
            let part = Self {
                members: half.iter().map(|&at| self.members[at]).collect(),
                unseen: half.iter().map(|&at| self.unseen[at]).collect(),
                probes: self.probes.clone(),
                n_sky: self.n_sky,
                n_columns: self.n_columns,
                rows: half.iter().flat_map(|&at| &self.rows[at * row_length..(at + 1) * row_length]).copied().collect(),
            };
            part.without_empty_columns(settings)
        })
    }

    /// Leaves out probes, and the sky, whose columns are zero for all members.
    fn without_empty_columns(self, settings: &RefineSettings) -> Self {
        let n_sh = settings.n_sh;
        let blocks = self.probes.len();
        let mut used = vec![false; blocks + 1];
        for row in self.rows.chunks_exact(self.n_columns) {
            for (block, used) in used.iter_mut().enumerate() {
                let columns = block * n_sh..((block + 1) * n_sh).min(self.n_columns);
                let columns = if block == blocks { blocks * n_sh..self.n_columns } else { columns };
                *used = *used || row[columns].iter().any(|&value| value != 0.0);
            }
        }
        if used.iter().all(|&used| used) {
            return self;
        }
        let mut rows = Vec::new();
        for row in self.rows.chunks_exact(self.n_columns) {
            for (block, chunk) in row[..blocks * n_sh].chunks_exact(n_sh).enumerate() {
                if used[block] {
                    rows.extend_from_slice(chunk);
                }
            }
            if used[blocks] {
                rows.extend_from_slice(&row[blocks * n_sh..]);
            }
        }
        let probes: Vec<u32> =
            self.probes.iter().zip(&used).filter(|&(_, &used)| used).map(|(&probe, _)| probe).collect();
        let n_sky = if used[blocks] { self.n_sky } else { 0 };
        Self { n_columns: probes.len() * n_sh + n_sky, probes, n_sky, rows, ..self }
    }
}

/// Coordinate of each member along the first principal direction of its rows about their mean, from `U S`.
fn principal_scores(svd: &TruncatedSvd, n_members: usize, n_k: usize) -> Vec<f64> {
    let n = n_k * svd.rank;
    let mut points: Vec<f64> = Vec::with_capacity(n_members * n);
    for row in svd.u.chunks_exact(svd.rank) {
        points.extend(row.iter().zip(&svd.sigma_squared).map(|(&u, sigma)| f64::from(u) * sigma.sqrt()));
    }
    let mut mean = vec![0.0; n];
    for point in points.chunks_exact(n) {
        for (mean, value) in mean.iter_mut().zip(point) {
            *mean += value / n_members as f64;
        }
    }
    for point in points.chunks_exact_mut(n) {
        for (value, mean) in point.iter_mut().zip(&mean) {
            *value -= mean;
        }
    }
    // Power iteration from the point farthest from the mean; the split needs a good direction, not an exact one.
    let squared = |point: &[f64]| point.iter().map(|value| value * value).sum::<f64>();
    let start = points.chunks_exact(n).enumerate().fold((0, -1.0), |held, (index, point)| {
        let size = squared(point);
        if size > held.1 { (index, size) } else { held }
    });
    let mut direction = points[start.0 * n..(start.0 + 1) * n].to_vec();
    let mut scores = vec![0.0; n_members];
    for _ in 0..20 {
        let length = squared(&direction).sqrt();
        if length <= 0.0 {
            break;
        }
        for value in &mut direction {
            *value /= length;
        }
        for (score, point) in scores.iter_mut().zip(points.chunks_exact(n)) {
            *score = point.iter().zip(&direction).map(|(a, b)| a * b).sum();
        }
        direction.fill(0.0);
        for (score, point) in scores.iter().zip(points.chunks_exact(n)) {
            for (sum, value) in direction.iter_mut().zip(point) {
                *sum += score * value;
            }
        }
    }
    scores
}
