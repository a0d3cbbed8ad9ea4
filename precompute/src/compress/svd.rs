//! Truncated singular value decomposition; with the matrices of the fit, the only file that names faer.
//!
//! Randomized subspace iteration (Halko, Martinsson and Tropp 2011): a few more random directions than wanted, two power
//! iterations, and the exact decomposition of the small projected matrix. What is left out is measured by the caller
//! against the matrix itself, so that an unlucky draw shows. All of it runs on one thread, whatever faer's global setting is:
//! one cluster is one sequential decomposition, since faer's parallel ones are not bit-stable.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::householder::{
    apply_block_householder_sequence_on_the_left_in_place_scratch as q_scratch,
    apply_block_householder_sequence_on_the_left_in_place_with_conj as apply_q,
};
use faer::linalg::qr::no_pivoting::factor::{qr_in_place, qr_in_place_scratch, recommended_block_size};
use faer::{Accum, Conj, Mat, MatMut, MatRef, Par, Spec, diag::Diag, linalg::matmul::matmul};
use localprt_formats::directions::counter_uniform;
use std::cell::RefCell;
use std::collections::BTreeMap;

/// Random directions beyond the wanted rank.
const OVERSAMPLING: usize = 8;
/// Power iterations; with eight extra directions two leave an excess of 1e-4 in the Frobenius error.
const POWER_ITERATIONS: usize = 2;

/// `T ~ U P` with orthonormal columns of U and `P = S V^T`, by falling singular values.
pub struct TruncatedSvd {
    /// Rows of T.
    pub n_rows: usize,
    /// Columns of T.
    pub n_columns: usize,
    /// Kept rank.
    pub rank: usize,
    /// `[n_rows][rank]`, row-major.
    pub u: Vec<f32>,
    /// `[rank][n_columns]`, row-major.
    pub p: Vec<f32>,
    /// Squared singular values.
    pub sigma_squared: Vec<f64>,
    /// Squared Frobenius norm of T.
    pub norm_squared: f64,
}

impl TruncatedSvd {
    /// Of a matrix without columns.
    pub fn empty(n_rows: usize) -> Self {
        Self {
            n_rows,
            n_columns: 0,
            rank: 0,
            u: Vec::new(),
            p: Vec::new(),
            sigma_squared: Vec::new(),
            norm_squared: 0.0,
        }
    }
}

/// Decomposes a row-major matrix, keeping at most `rank` singular values.
///
/// Signs: the entry of largest magnitude in each column of U is positive.
pub fn truncated_svd(values: &[f32], n_rows: usize, n_columns: usize, rank: usize) -> TruncatedSvd {
    let t = MatRef::from_row_major_slice(values, n_rows, n_columns);
    let norm_squared = squared_norm(values);
    let width = (rank + OVERSAMPLING).min(n_rows).min(n_columns);
    // Q spans (nearly) the range of T; P' = Q^T T.
    let q = if width == n_rows {
        Mat::<f32>::identity(n_rows, n_rows)
    } else {
        let mut q = orthonormal(product(t, sketch(1, n_columns, width).as_ref()));
        for _ in 0..POWER_ITERATIONS {
            let z = orthonormal(product(t.transpose(), q.as_ref()));
            q = orthonormal(product(t, z.as_ref()));
        }
        q
    };
    let projected = product(q.transpose(), t);
    let wide = Mat::<f64>::from_fn(projected.nrows(), projected.ncols(), |i, j| f64::from(projected[(i, j)]));
    let mut gram = Mat::<f64>::zeros(width, width);
    matmul(&mut gram, Accum::Replace, &wide, wide.transpose(), 1.0, Par::Seq);
    let Some((values, vectors)) = eigen(&gram) else {
        // Only non-finite input does this, and rows are finite by construction.
        panic!("singular values of a {n_rows} x {n_columns} transport matrix did not converge");
    };
    let rank = rank.min(width);
    let sigma_squared = values[..rank].iter().map(|value| value.max(0.0)).collect();
    let mut turn = Mat::<f32>::from_fn(width, rank, |row, column| vectors[(row, column)] as f32);
    let mut u = product(q.as_ref(), turn.as_ref());
    for column in 0..rank {
        let larger = |held: f32, &value: &f32| if value.abs() > held.abs() { value } else { held };
        if u.col(column).iter().fold(0.0, larger) < 0.0 {
            u.col_mut(column).iter_mut().chain(turn.col_mut(column).iter_mut()).for_each(|value| *value = -*value);
        }
    }
    let p = product(turn.transpose(), projected.as_ref());
    TruncatedSvd { n_rows, n_columns, rank, u: row_major(&u), p: row_major(&p), sigma_squared, norm_squared }
}

/// Squared Frobenius norms of the rows of `T - U P`, for row-major factors of any rank.
pub fn residual_by_row(values: &[f32], u: &[f32], p: &[f32], rank: usize, n_columns: usize) -> Vec<f64> {
    let n_rows = values.len() / n_columns;
    if rank == 0 {
        return values.chunks_exact(n_columns).map(squared_norm).collect();
    }
    let u = MatRef::from_row_major_slice(u, n_rows, rank);
    let p = MatRef::from_row_major_slice(p, rank, n_columns);
    // Transposed, so that faer's columns are our rows.
    let mut difference = MatRef::from_row_major_slice(values, n_rows, n_columns).transpose().to_owned();
    matmul(&mut difference, Accum::Add, p.transpose(), u.transpose(), -1.0, Par::Seq);
    (0..n_rows).map(|row| squared_norm(difference.col_as_slice(row))).collect()
}

fn squared_norm(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value) * f64::from(value)).sum()
}

/// Random directions, `n_rows` high. Those of a width begin alike, and each thread keeps the longest.
pub(crate) fn sketch(stream: u64, n_rows: usize, width: usize) -> Mat<f32> {
    thread_local! {
        static KEPT: RefCell<BTreeMap<(u64, usize), Vec<f32>>> = const { RefCell::new(BTreeMap::new()) };
    }
    KEPT.with_borrow_mut(|kept| {
        let values = kept.entry((stream, width)).or_default();
        values.extend((values.len()..n_rows * width).map(|counter| {
            // Sums of two uniforms are near enough to normal.
            let counter = counter as u64;
            (counter_uniform(stream, counter, 0) + counter_uniform(stream, counter, 1) - 1.0) as f32
        }));
        MatRef::from_row_major_slice(&values[..n_rows * width], n_rows, width).to_owned()
    })
}

pub(crate) fn product(a: MatRef<'_, f32>, b: MatRef<'_, f32>) -> Mat<f32> {
    let mut result = Mat::zeros(a.nrows(), b.ncols());
    matmul(&mut result, Accum::Replace, a, b, 1.0, Par::Seq);
    result
}

/// Orthonormal columns that span those of a matrix with at least as many rows: Q of its QR decomposition.
pub(crate) fn orthonormal(mut matrix: Mat<f32>) -> Mat<f32> {
    let (m, n) = matrix.shape();
    let block = recommended_block_size::<f32>(m, n);
    let scratch = qr_in_place_scratch::<f32>(m, n, block, Par::Seq, Spec::default()).or(q_scratch::<f32>(m, block, n));
    let mut memory = MemBuffer::new(scratch);
    let (mut factor, mut q) = (Mat::zeros(block, n), Mat::identity(m, n));
    qr_in_place(matrix.as_mut(), factor.as_mut(), Par::Seq, MemStack::new(&mut memory), Spec::default());
    apply_q(matrix.as_ref(), factor.as_ref(), Conj::No, q.as_mut(), Par::Seq, MemStack::new(&mut memory));
    q
}

/// Eigenvalues of a symmetric matrix, falling, and their vectors, by column; `None` if it is not finite.
pub(crate) fn eigen(symmetric: &Mat<f64>) -> Option<(Vec<f64>, Mat<f64>)> {
    let n = symmetric.nrows();
    let (mut values, mut vectors) = (Diag::zeros(n), Mat::zeros(n, n));
    let scratch = self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, Spec::default());
    let (mut memory, turned) = (MemBuffer::new(scratch), Some(vectors.as_mut()));
    let stack = MemStack::new(&mut memory);
    self_adjoint_evd(symmetric.as_ref(), values.as_mut(), turned, Par::Seq, stack, Spec::default()).ok()?;
    // They rise.
    Some((values.column_vector().iter().rev().copied().collect(), vectors.as_ref().reverse_cols().to_owned()))
}

pub(crate) fn row_major(matrix: &Mat<f32>) -> Vec<f32> {
    let mut values = Vec::with_capacity(matrix.nrows() * matrix.ncols());
    for row in 0..matrix.nrows() {
        values.extend(matrix.row(row).iter());
    }
    values
}

/// `AᵀB` of row-major `[n][a]` and `[n][b]`, row-major `[a][b]`.
pub(crate) fn transposed_product(a: &[f32], n_a: usize, b: &[f32], n_b: usize) -> Vec<f32> {
    let n = a.len() / n_a.max(1);
    row_major_product(MatRef::from_row_major_slice(a, n, n_a).transpose(), MatRef::from_row_major_slice(b, n, n_b))
}

/// `AB` of row-major `[m][n]` and `[n][b]`, row-major `[m][b]`.
pub(crate) fn row_product(a: &[f32], n: usize, b: &[f32], n_b: usize) -> Vec<f32> {
    let m = a.len() / n.max(1);
    row_major_product(MatRef::from_row_major_slice(a, m, n), MatRef::from_row_major_slice(b, n, n_b))
}

fn row_major_product(a: MatRef<'_, f32>, b: MatRef<'_, f32>) -> Vec<f32> {
    let mut product = vec![0.0; a.nrows() * b.ncols()];
    let into = MatMut::from_row_major_slice_mut(&mut product, a.nrows(), b.ncols());
    matmul(into, Accum::Replace, a, b, 1.0, Par::Seq);
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix with singular values exp(-i / 6) and seeded random vectors.
    fn sample(n_rows: usize, n_columns: usize) -> Vec<f32> {
        let random = |stream: u64, n: usize| {
            Mat::<f32>::from_fn(n, n_rows.min(n_columns), |i, j| {
                counter_uniform(9, stream, (i * 5000 + j) as u64) as f32 - 0.5
            })
        };
        let (a, b) = (orthonormal(random(1, n_rows)), orthonormal(random(2, n_columns)));
        let scaled = Mat::<f32>::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] * (-(j as f32) / 6.0).exp());
        row_major(&product(scaled.as_ref(), b.transpose()))
    }

    #[test]
    fn dropped_energy_is_the_sum_of_dropped_singular_values() {
        for (n_rows, n_columns) in [(200, 300), (300, 120), (20, 300)] {
            let matrix = sample(n_rows, n_columns);
            let rank = 12;
            let svd = truncated_svd(&matrix, n_rows, n_columns, rank);
            let residual: f64 = residual_by_row(&matrix, &svd.u, &svd.p, rank, n_columns).iter().sum();
            let n = n_rows.min(n_columns);
            let dropped: f64 = (rank..n).map(|i| (-(i as f64) / 3.0).exp()).sum();
            // f32 entries of a matrix of norm ~1.8 with relative error 6e-8: energy good to 1e-6 of the norm; the sketch
            // may exceed the best possible by 1e-3 of the dropped energy.
            assert!((residual - dropped).abs() < 2e-6 + 1e-3 * dropped, "{n_rows}x{n_columns}: {residual} {dropped}");
            for (i, sigma) in svd.sigma_squared.iter().enumerate() {
                assert!((sigma / (-(i as f64) / 3.0).exp() - 1.0).abs() < 1e-3, "value {i}: {sigma}");
            }
        }
    }

    #[test]
    fn signs_follow_the_rule_and_rank_may_exceed_the_matrix() {
        let matrix = sample(10, 40);
        let svd = truncated_svd(&matrix, 10, 40, 32);
        assert_eq!(svd.rank, 10);
        for column in 0..svd.rank {
            let largest = (0..10)
                .map(|row| svd.u[row * svd.rank + column])
                .fold(0.0f32, |held, value| if value.abs() > held.abs() { value } else { held });
            assert!(largest > 0.0);
        }
        let residual: f64 = residual_by_row(&matrix, &svd.u, &svd.p, svd.rank, 40).iter().sum();
        assert!(residual < 1e-10, "{residual}");
    }
}
