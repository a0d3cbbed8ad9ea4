//! Adaptive refinement of a leaf: split along the main direction of transport space, and keep as many singular values in
//! each part as pay for their bytes, so that the leaf holds the error threshold with as few bytes as possible.
//!
//! The paper leaves the rule open. Ours cuts a part in two at the median of the first principal coordinate of its rows, or
//! of the place along its longest axis, whichever compresses better, then lets receivers change sides as in clustered PCA
//! (Sloan et al. 2003); and again for each half. In the binary tree of parts the cuts and the numbers of values are chosen
//! together by one price of an error against a byte (Chou, Lookabaugh and Gray 1989); the highest price of bytes at which
//! the leaf's RMS error per row stays within the threshold wins.
//!
//! Where rows are fitted an error of a row counts by what it does to irradiance (the rows' [`Metric`]): what hardly occurs
//! in light, fine detail as a probe sees it above all, need not be kept. See `docs/fitted-transport.md`.
//!
//! Differs from the paper: there the threshold holds for each cluster. Holding it for each leaf lets receivers whose rows
//! differ by sampling noise keep a little more error than those with smooth rows.

use super::Cluster;
use crate::{
    compress::{
        CompressedRows, compress, compress_weighted, least_rank,
        svd::{TruncatedSvd, row_product, truncated_svd},
    },
    transport::{Metric, TransportRows},
};
use glam::Vec3;
use nalgebra::{DMatrix, DVector};
use std::{collections::BTreeMap, rc::Rc};

/// When a leaf is good enough.
#[derive(Clone, Copy, Debug)]
pub struct RefineSettings {
    /// Largest RMS error per row, as the rows' metric has it.
    pub threshold: f64,
    /// Most singular values.
    pub max_coefficients: usize,
    /// Columns per probe.
    pub n_sh: usize,
    /// Sky columns.
    pub n_sky: usize,
}

/// Parts of at most this many receivers are not split further unless the cap on singular values forces it.
const SMALL_PART: usize = 8;
/// Bytes of a cluster beside its matrices: its record, and four a probe.
const RECORD_BYTES: f64 = 40.0;
/// Steps of the bisection of the price, over 12 orders of magnitude.
const PRICE_STEPS: usize = 48;
/// Rounds of moving members between halves.
const REASSIGNMENTS: usize = 6;
/// Dimensions of a half's subspace while members are moved; 4 saves 2 % more bytes than 8 or 16 on a detailed scene.
const SUBSPACE: usize = 4;
/// Bytes that a row takes in a detailed scene, to weigh ways to split before the price is known.
const USUAL_BYTES_PER_ROW: f64 = 400.0;

/// A cluster under way: rows of some members of a leaf, without the columns that none of them uses.
struct Part {
    members: Vec<u32>,
    unseen: Vec<f32>,
    probes: Vec<u32>,
    n_sky: usize,
    n_columns: usize,
    rows: Vec<f32>,
    weighted: Option<Weighted>,
}

/// Rows of a part as their errors count.
struct Weighted {
    /// Of the leaf.
    metric: Rc<Metric>,
    /// Which of the leaf's columns the part has.
    columns: Vec<u32>,
    /// T W, `[n_rows][n]`.
    rows: Vec<f32>,
}

/// A node of the tree of parts.
struct Node {
    part: Part,
    svd: TruncatedSvd,
    halves: Option<[usize; 2]>,
}

/// Index of a node and which of its halves; `None` is the root.
type Place = Option<(usize, usize)>;

/// What is kept of a subtree at some price.
#[derive(Clone, Copy, Debug, Default)]
struct Choice {
    /// Squared error.
    error: f64,
    bytes: f64,
    /// Singular values of the node itself; `None` where its halves are kept instead.
    rank: Option<usize>,
}

/// Compresses the rows of `members`; the clusters cover the members once, in splitting order. `positions` are those of all
/// receivers.
pub fn refine(members: &[u32], positions: &[Vec3], rows: TransportRows, settings: &RefineSettings) -> Vec<Cluster> {
    if rows.metric.is_none() || rows.n_columns == 0 {
        return refine_connected(members, positions, rows, settings);
    }
    // By their coefficients, rows without a common probe never mix. By a metric they would, wherever the light that it expects
    // is alike: light would leak between sealed rooms. So they are kept apart.
    let groups = sharing_probes(&rows, settings.n_sh);
    if groups.len() < 2 {
        return refine_connected(members, positions, rows, settings);
    }
    let length = rows.n_k * rows.n_columns;
    let of_group = |group: &Vec<usize>| {
        let some = TransportRows {
            probes: rows.probes.clone(),
            n_columns: rows.n_columns,
            n_k: rows.n_k,
            rows: group.iter().flat_map(|&at| &rows.rows[at * length..(at + 1) * length]).copied().collect(),
            unseen: group.iter().map(|&at| rows.unseen[at]).collect(),
            metric: rows.metric.clone(),
            ..TransportRows::default()
        };
        let members: Vec<u32> = group.iter().map(|&at| members[at]).collect();
        refine_connected(&members, positions, some, settings)
    };
    groups.iter().flat_map(of_group).collect()
}

/// Members, by place, that are joined by common probes; those without any probe together.
fn sharing_probes(rows: &TransportRows, n_sh: usize) -> Vec<Vec<usize>> {
    fn root(parents: &[usize], mut block: usize) -> usize {
        while parents[block] != block {
            block = parents[block];
        }
        block
    }
    let n_probes = rows.probes.len();
    // The last stands for no probe.
    let mut parents: Vec<usize> = (0..=n_probes).collect();
    let mut first_used = Vec::new();
    for of_member in rows.rows.chunks_exact(rows.n_k * rows.n_columns) {
        let is_used = |&probe: &usize| {
            let mut of_probe = of_member.chunks_exact(rows.n_columns).map(|row| &row[probe * n_sh..(probe + 1) * n_sh]);
            of_probe.any(|values| values.iter().any(|&value| value != 0.0))
        };
        let used: Vec<usize> = (0..n_probes).filter(is_used).collect();
        let first = used.first().copied().unwrap_or(n_probes);
        for &probe in &used {
            let (a, b) = (root(&parents, first), root(&parents, probe));
            parents[a.max(b)] = a.min(b);
        }
        first_used.push(first);
    }
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (member, &first) in first_used.iter().enumerate() {
        groups.entry(root(&parents, first)).or_default().push(member);
    }
    groups.into_values().collect()
}

/// Compresses rows that may share clusters.
fn refine_connected(
    members: &[u32],
    positions: &[Vec3],
    rows: TransportRows,
    settings: &RefineSettings,
) -> Vec<Cluster> {
    let n_k = rows.n_k;
    let weighted = rows.metric.map(|metric| Weighted {
        rows: row_product(&rows.rows, rows.n_columns, &metric.matrix, metric.n),
        columns: (0..rows.n_columns as u32).collect(),
        metric: Rc::new(metric),
    });
    let whole = Part {
        weighted,
        members: members.to_vec(),
        unseen: rows.unseen,
        probes: rows.probes,
        n_sky: settings.n_sky,
        n_columns: rows.n_columns,
        rows: rows.rows,
    };
    let tree = grow(whole.without_empty_columns(settings), positions, n_k, settings);
    let allowed = settings.threshold * settings.threshold * (members.len() * n_k) as f64;
    // Rounding to f16 adds a little error after the choice: ask for less until the sum holds.
    let mut asked = allowed;
    loop {
        let choices = cheapest(&tree, asked);
        let clusters = finish(&tree, &choices);
        let error: f64 = clusters.iter().flat_map(|cluster| &cluster.rows.row_error_squared).sum();
        // Nothing is left to gain once every value is kept.
        if error <= allowed || asked < 1e-3 * allowed || choices[0].error <= 0.0 {
            return clusters;
        }
        asked *= 0.97;
    }
}

/// The tree of parts, a node before its halves.
fn grow(whole: Part, positions: &[Vec3], n_k: usize, settings: &RefineSettings) -> Vec<Node> {
    let mut tree: Vec<Node> = Vec::new();
    let svd = whole.decompose(n_k, settings);
    // Node and half that each belongs to.
    let mut open: Vec<(Part, TruncatedSvd, Place)> = vec![(whole, svd, None)];
    while let Some((part, svd, place)) = open.pop() {
        let index = tree.len();
        if let Some((parent, half)) = place {
            tree[parent].halves.get_or_insert([0, 0])[half] = index;
        }
        // A few values leave most of the error allowed: nothing to win by splitting.
        let allowed = settings.threshold * settings.threshold * svd.n_rows as f64;
        let is_simple = least_rank(&svd, 0.25 * allowed).is_some_and(|rank| rank <= 4);
        let is_small = part.members.len() <= SMALL_PART && svd.n_rows <= settings.max_coefficients;
        if part.members.len() > 1 && !is_simple && !is_small {
            let [lower, upper] = part.split(&svd, positions, n_k, settings);
            open.push((upper.0, upper.1, Some((index, 1))));
            open.push((lower.0, lower.1, Some((index, 0))));
        }
        tree.push(Node { part, svd, halves: None });
    }
    tree
}

/// The choice of fewest bytes whose squared error is at most `allowed`, or that of least error if there is none.
fn cheapest(tree: &[Node], allowed: f64) -> Vec<Choice> {
    // Squared error per byte; from one where nothing is kept to one where everything is.
    let (mut low, mut high) = (-30.0f64, 10.0f64);
    let mut best = choose(tree, low.exp());
    for _ in 0..PRICE_STEPS {
        let middle = 0.5 * (low + high);
        let choices = choose(tree, middle.exp());
        if choices[0].error <= allowed {
            low = middle;
            best = choices;
        } else {
            high = middle;
        }
    }
    best
}

/// The best choice at every node for a price of a byte in squared error.
fn choose(tree: &[Node], price: f64) -> Vec<Choice> {
    let mut choices = vec![Choice::default(); tree.len()];
    // Halves come after their node.
    for (index, node) in tree.iter().enumerate().rev() {
        let cost = |choice: &Choice| choice.error + price * choice.bytes;
        let mut best = best_rank(&node.part, &node.svd, price);
        if let Some([lower, upper]) = node.halves {
            let (lower, upper) = (&choices[lower], &choices[upper]);
            let halves = Choice { error: lower.error + upper.error, bytes: lower.bytes + upper.bytes, rank: None };
            if cost(&halves) < cost(&best) {
                best = halves;
            }
        }
        choices[index] = best;
    }
    choices
}

/// The best number of values of one part for a price of a byte in squared error.
fn best_rank(part: &Part, svd: &TruncatedSvd, price: f64) -> Choice {
    let fixed = RECORD_BYTES + 4.0 * part.probes.len() as f64;
    let per_value = 2.0 * (part.n_columns as f64 + svd.n_rows as f64);
    let mut best = Choice { error: svd.norm_squared, bytes: fixed, rank: Some(0) };
    let mut kept = best;
    for (value, sigma_squared) in svd.sigma_squared.iter().enumerate() {
        kept.error = (kept.error - sigma_squared).max(0.0);
        kept.bytes += per_value;
        kept.rank = Some(value + 1);
        if kept.error + price * kept.bytes < best.error + price * best.bytes {
            best = kept;
        }
    }
    best
}

/// Compresses the chosen parts, lower halves first.
fn finish(tree: &[Node], choices: &[Choice]) -> Vec<Cluster> {
    let mut clusters = Vec::new();
    let mut open = vec![0];
    while let Some(index) = open.pop() {
        let node = &tree[index];
        match (choices[index].rank, node.halves) {
            (None, Some([lower, upper])) => open.extend([upper, lower]),
            (rank, _) => clusters.push(node.part.cluster(&node.svd, rank.unwrap_or(0))),
        }
    }
    clusters
}

impl Part {
    /// The part with its first `rank` singular values; one that keeps none needs no columns.
    fn cluster(&self, svd: &TruncatedSvd, rank: usize) -> Cluster {
        let rows = if rank == 0 {
            let (rows, n) = self.measured();
            CompressedRows::none(rows, svd.n_rows, n)
        } else if let Some(weighted) = &self.weighted {
            compress_weighted(&self.rows, &weighted.rows, &weighted.matrix(), svd, rank)
        } else {
            compress(&self.rows, svd, rank)
        };
        Cluster {
            members: self.members.clone(),
            probes: if rank == 0 { Vec::new() } else { self.probes.clone() },
            n_sky: if rank == 0 { 0 } else { self.n_sky },
            unseen: self.unseen.clone(),
            rows,
        }
    }

    /// The rows as their errors count, and their columns.
    fn measured(&self) -> (&[f32], usize) {
        self.weighted.as_ref().map_or((&self.rows, self.n_columns), |weighted| (&weighted.rows, weighted.metric.n))
    }

    fn decompose(&self, n_k: usize, settings: &RefineSettings) -> TruncatedSvd {
        let n_rows = self.members.len() * n_k;
        if self.n_columns == 0 {
            return TruncatedSvd::empty(n_rows);
        }
        let (rows, n) = self.measured();
        truncated_svd(rows, n_rows, n, settings.max_coefficients.min(n_rows))
    }

    /// Two halves with their decompositions.
    fn split(
        &self,
        svd: &TruncatedSvd,
        positions: &[Vec3],
        n_k: usize,
        settings: &RefineSettings,
    ) -> [(Self, TruncatedSvd); 2] {
        let n_members = self.members.len();
        let places = || self.members.iter().map(|&member| positions[member as usize]);
        let (low, high) =
            places().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), place| (low.min(place), high.max(place)));
        let size = high - low;
        let axis = size.max_position();
        let scores = [principal_scores(svd, n_members, n_k), places().map(|place| f64::from(place[axis])).collect()];
        // The price of a byte at which a part of this size would just keep the threshold, about.
        let price = settings.threshold * settings.threshold / USUAL_BYTES_PER_ROW;
        let halve = |lower: &[usize], upper: &[usize]| {
            let halves = [lower, upper].map(|half| {
                let part = self.only(half, n_k, settings);
                let svd = part.decompose(n_k, settings);
                (part, svd)
            });
            let cost: f64 = halves
                .iter()
                .map(|(part, svd)| {
                    let choice = best_rank(part, svd, price);
                    choice.error + price * choice.bytes
                })
                .sum();
            (cost, halves)
        };
        let [rows, places] = scores.map(|scores| {
            let mut order: Vec<usize> = (0..n_members).collect();
            order.sort_by(|&a, &b| scores[a].total_cmp(&scores[b]).then(self.members[a].cmp(&self.members[b])));
            let upper = order.split_off(n_members / 2);
            let (cost, halves) = halve(&order, &upper);
            (cost, halves, order, upper)
        });
        let best = if places.0 < rows.0 { places } else { rows };
        // Let each receiver change to the half whose subspace holds its rows better (Sloan et al. 2003).
        if let Some([lower, upper]) = reassign(svd, n_members, n_k, &best.2, &best.3) {
            let (cost, halves) = halve(&lower, &upper);
            if cost < best.0 {
                return halves;
            }
        }
        best.1
    }

    /// The rows of some members, without the columns that none of them uses.
    fn only(&self, half: &[usize], n_k: usize, settings: &RefineSettings) -> Self {
        let mut half = half.to_vec();
        half.sort_unstable();
        let of_members = |rows: &[f32], length: usize| -> Vec<f32> {
            let mut own = Vec::with_capacity(half.len() * n_k * length);
            half.iter().for_each(|&at| own.extend_from_slice(&rows[at * n_k * length..(at + 1) * n_k * length]));
            own
        };
        let part = Self {
            weighted: self.weighted.as_ref().map(|weighted| Weighted {
                metric: weighted.metric.clone(),
                columns: weighted.columns.clone(),
                rows: of_members(&weighted.rows, weighted.metric.n),
            }),
            members: half.iter().map(|&at| self.members[at]).collect(),
            unseen: half.iter().map(|&at| self.unseen[at]).collect(),
            probes: self.probes.clone(),
            n_sky: self.n_sky,
            n_columns: self.n_columns,
            rows: of_members(&self.rows, self.n_columns),
        };
        part.without_empty_columns(settings)
    }

    /// Leaves out probes, and the sky, whose columns are zero for all members.
    fn without_empty_columns(self, settings: &RefineSettings) -> Self {
        if self.n_columns == 0 {
            return self;
        }
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
        let mut rows = Vec::with_capacity(self.rows.len());
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
        let weighted = self.weighted.map(|weighted| {
            let columns = weighted.columns.iter().enumerate().filter(|(column, _)| used[(column / n_sh).min(blocks)]);
            Weighted { columns: columns.map(|(_, &column)| column).collect(), ..weighted }
        });
        let probes: Vec<u32> =
            self.probes.iter().zip(&used).filter(|&(_, &used)| used).map(|(&probe, _)| probe).collect();
        let n_sky = if used[blocks] { self.n_sky } else { 0 };
        Self { n_columns: probes.len() * n_sh + n_sky, probes, n_sky, rows, weighted, ..self }
    }
}

impl Weighted {
    /// W of the part's columns, `[n_columns][n]`.
    fn matrix(&self) -> Vec<f32> {
        let n = self.metric.n;
        let mut own = Vec::with_capacity(self.columns.len() * n);
        self.columns.iter().for_each(|&column| own.extend_from_slice(&self.metric.matrix[column as usize * n..][..n]));
        own
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

/// Halves after moving members to the half whose subspace holds their rows better, a few times; `None` if one would be
/// left with almost nobody.
fn reassign(
    svd: &TruncatedSvd,
    n_members: usize,
    n_k: usize,
    lower: &[usize],
    upper: &[usize],
) -> Option<[Vec<usize>; 2]> {
    let rank = svd.rank;
    let points: Vec<DVector<f64>> = svd
        .u
        .chunks_exact(rank)
        .map(|row| {
            DVector::from_iterator(rank, row.iter().zip(&svd.sigma_squared).map(|(&u, s)| f64::from(u) * s.sqrt()))
        })
        .collect();
    let kept = SUBSPACE.min(rank);
    let mut halves = [lower.to_vec(), upper.to_vec()];
    for _ in 0..REASSIGNMENTS {
        let subspaces = halves.each_ref().map(|half| {
            let mut gram = DMatrix::<f64>::zeros(rank, rank);
            for point in half.iter().flat_map(|&member| &points[member * n_k..(member + 1) * n_k]) {
                gram.ger(1.0, point, point, 1.0);
            }
            let eigen = gram.symmetric_eigen();
            let mut order: Vec<usize> = (0..rank).collect();
            order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]).then(a.cmp(&b)));
            let columns: Vec<DVector<f64>> =
                order[..kept].iter().map(|&column| eigen.eigenvectors.column(column).into_owned()).collect();
            DMatrix::from_columns(&columns)
        });
        let mut next = [Vec::new(), Vec::new()];
        for member in 0..n_members {
            let held = |subspace: &DMatrix<f64>| -> f64 {
                points[member * n_k..(member + 1) * n_k].iter().map(|point| subspace.tr_mul(point).norm_squared()).sum()
            };
            let [first, second] = subspaces.each_ref().map(held);
            next[usize::from(second > first)].push(member);
        }
        if next.iter().any(|half| half.len() < (n_members / 8).max(1)) {
            return None;
        }
        if next == halves {
            break;
        }
        halves = next;
    }
    Some(halves)
}
