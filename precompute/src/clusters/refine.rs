//! Adaptive refinement of a leaf: split along the main direction of transport space, and keep as many singular values in
//! each part as pay for their bytes, so that the leaf holds the error threshold with as few bytes as possible.
//!
//! The paper leaves the rule open. Ours: a part's receivers are ordered by their coordinate along the first principal
//! direction of its rows about their mean and cut at the median, again and again. In the binary tree of parts the cut and
//! the number of values are chosen together by one price of an error against a byte (Chou, Lookabaugh and Gray 1989); the
//! highest price of bytes at which the leaf's RMS error per row stays within the threshold wins.
//!
//! Differs from the paper: there the threshold holds for each cluster. Holding it for each leaf lets receivers whose rows
//! differ by sampling noise keep a little more error than those with smooth rows.

use super::Cluster;
use crate::{
    compress::{
        CompressedRows, compress, least_rank,
        svd::{TruncatedSvd, truncated_svd},
    },
    transport::TransportRows,
};

/// When a leaf is good enough.
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

/// Parts of at most this many receivers are not split further unless the cap on singular values forces it.
const SMALL_PART: usize = 16;
/// Bytes of a cluster beside its matrices: its record, and four a probe.
const RECORD_BYTES: f64 = 40.0;
/// Steps of the bisection of the price, over 12 orders of magnitude.
const PRICE_STEPS: usize = 48;

/// A cluster under way: rows of some members of a leaf, without the columns that none of them uses.
struct Part {
    members: Vec<u32>,
    unseen: Vec<f32>,
    probes: Vec<u32>,
    n_sky: usize,
    n_columns: usize,
    rows: Vec<f32>,
}

/// A node of the tree of parts.
struct Node {
    part: Part,
    svd: TruncatedSvd,
    halves: Option<[usize; 2]>,
}

/// What is kept of a subtree at some price.
#[derive(Clone, Copy, Debug, Default)]
struct Choice {
    /// Squared error.
    error: f64,
    bytes: f64,
    /// Singular values of the node itself; `None` where its halves are kept instead.
    rank: Option<usize>,
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
    let tree = grow(whole.without_empty_columns(settings), n_k, settings);
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
fn grow(whole: Part, n_k: usize, settings: &RefineSettings) -> Vec<Node> {
    let mut tree: Vec<Node> = Vec::new();
    let mut open: Vec<(Part, Option<(usize, usize)>)> = vec![(whole, None)];
    while let Some((part, place)) = open.pop() {
        let n_rows = part.members.len() * n_k;
        let svd = if part.n_columns == 0 {
            TruncatedSvd::empty(n_rows)
        } else {
            truncated_svd(&part.rows, n_rows, part.n_columns, settings.max_coefficients.min(n_rows))
        };
        let index = tree.len();
        if let Some((parent, half)) = place {
            tree[parent].halves.get_or_insert([0, 0])[half] = index;
        }
        // A few values leave half of the error allowed: nothing to win by splitting.
        let allowed = settings.threshold * settings.threshold * n_rows as f64;
        let is_simple = least_rank(&svd, 0.25 * allowed).is_some_and(|rank| rank <= 4);
        let is_small = part.members.len() <= SMALL_PART && n_rows <= settings.max_coefficients;
        if part.members.len() > 1 && !is_simple && !is_small {
            let [lower, upper] = part.split(&svd, n_k, settings);
            open.push((upper, Some((index, 1))));
            open.push((lower, Some((index, 0))));
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
        let n_rows = node.svd.n_rows as f64;
        let fixed = RECORD_BYTES + 4.0 * node.part.probes.len() as f64;
        let per_value = 2.0 * (node.svd.n_columns as f64 + n_rows);
        let mut best = Choice { error: node.svd.norm_squared, bytes: fixed, rank: Some(0) };
        let mut kept = best;
        for (value, sigma_squared) in node.svd.sigma_squared.iter().enumerate() {
            kept.error = (kept.error - sigma_squared).max(0.0);
            kept.bytes += per_value;
            kept.rank = Some(value + 1);
            if cost(&kept) < cost(&best) {
                best = kept;
            }
        }
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
            CompressedRows::none(&self.rows, svd.n_rows, self.n_columns)
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

    /// Two halves by the first principal coordinate about the mean.
    fn split(&self, svd: &TruncatedSvd, n_k: usize, settings: &RefineSettings) -> [Self; 2] {
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
