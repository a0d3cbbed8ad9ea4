//! Small dense matrices of the fit; with the singular values, the only file that names faer. One thread, f32 unless said.

use crate::compress::svd::{eigen, orthonormal, product, row_major, sketch, transposed_product};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, solve::solve_in_place};
use faer::{Mat, MatMut, MatRef, Par, Spec};

/// Random directions beyond the wanted modes.
const OVERSAMPLING: usize = 8;
/// Power iterations of the search for modes.
const POWER_ITERATIONS: usize = 1;
/// Stream of random numbers of this file.
const STREAM: u64 = 0x6669_7400;

/// `MᵀM` of a row-major `[n_rows][n]` matrix.
pub(super) fn gram(matrix: &[f32], n_rows: usize) -> Vec<f32> {
    let n = matrix.len() / n_rows.max(1);
    transposed_product(matrix, n, matrix, n)
}

/// Solves `S z = y` for a symmetric positive definite `[n][n]` matrix, of which what is above the diagonal is not read, and row-major right
/// sides `[n_k][n]`; `None` if rounding left the matrix not positive definite.
pub(super) fn solve(system: &[f32], right: &[f32], n: usize) -> Option<Vec<f32>> {
    let mut solution = right.to_vec();
    let right = MatMut::from_column_major_slice_mut(&mut solution, n, right.len() / n);
    // It takes no scratch memory.
    solve_in_place(cholesky(system, n)?.as_ref(), right, Par::Seq, MemStack::new(&mut []));
    Some(solution)
}

/// L of `A = L Lᵀ` for a symmetric `[n][n]` matrix, of which what is above the diagonal is not read; `None` if it is not positive definite.
fn cholesky(matrix: &[f32], n: usize) -> Option<Mat<f32>> {
    let mut l = Mat::zeros(n, n);
    l.copy_from_triangular_lower(MatRef::from_row_major_slice(matrix, n, n));
    let mut memory = MemBuffer::new(factor::cholesky_in_place_scratch::<f32>(n, Par::Seq, Spec::default()));
    let stack = MemStack::new(&mut memory);
    factor::cholesky_in_place(l.as_mut(), Default::default(), Par::Seq, stack, Spec::default()).ok()?;
    // What is above the diagonal was scratch memory.
    (1..n).for_each(|column| l.col_mut(column).get_mut(..column).fill(0.0));
    Some(l)
}

/// Field modes that some probes see best: B `[n_patches][n_modes]`, row-major, with `B Bᵀ` as near to K as n_modes allow in
/// what `sqrt(weight) Λ` sees of it, and the variance that each adds there, falling.
///
/// `covariance` is K `[n][n]`; `views` are Λ_iᵀ `[n][n_sh]` with their weights. Modes of less than `least` times the mean
/// variance of a coefficient are left out; without patches, or if rounding left K not positive definite, there are none.
///
/// K = L Lᵀ; the modes are L times the leading right singular vectors of Λ L, by randomized subspace iteration (Halko,
/// Martinsson and Tropp 2011).
pub(super) fn leading_modes(
    covariance: &[f32],
    views: &[Vec<f32>],
    weights: &[f32],
    n_sh: usize,
    most: usize,
    least: f64,
) -> (Vec<f32>, usize) {
    let n = views.first().map_or(0, |view| view.len() / n_sh);
    let n_columns = views.len() * n_sh;
    if n == 0 {
        return (Vec::new(), 0);
    }
    let Some(l) = cholesky(covariance, n) else { return (Vec::new(), 0) };
    // Λᵀ, [n][n_columns].
    let mut seen = Mat::<f32>::zeros(n, n_columns);
    for (index, (view, weight)) in views.iter().zip(weights).enumerate() {
        let scale = weight.sqrt();
        for j in 0..n_sh {
            let column = seen.col_mut(index * n_sh + j);
            column.iter_mut().zip(view.iter().skip(j).step_by(n_sh)).for_each(|(to, from)| *to = scale * from);
        }
    }
    let width = (most + OVERSAMPLING).min(n).min(n_columns);
    let range =
        |columns: Mat<f32>| orthonormal(product(l.transpose(), product(seen.as_ref(), columns.as_ref()).as_ref()));
    let mut q = range(sketch(STREAM, n_columns, width));
    for _ in 0..POWER_ITERATIONS {
        q = range(product(seen.transpose(), product(l.as_ref(), q.as_ref()).as_ref()));
    }
    // Turned to the axes of what is seen.
    let modes = product(l.as_ref(), q.as_ref());
    let projected = product(seen.transpose(), modes.as_ref());
    let square = product(projected.transpose(), projected.as_ref());
    let wide = Mat::<f64>::from_fn(width, width, |i, j| f64::from(square[(i, j)]));
    let Some((variances, vectors)) = eigen(&wide) else { return (Vec::new(), 0) };
    // The smallest first.
    let total: f64 = variances.iter().rev().map(|variance| variance.max(0.0)).sum();
    let mean = total / n_columns.max(1) as f64;
    let n_modes = variances.iter().take(most).take_while(|&&variance| variance > least * mean).count();
    let turn = Mat::<f32>::from_fn(width, n_modes, |row, column| vectors[(row, column)] as f32);
    let turned = product(modes.as_ref(), turn.as_ref());
    (row_major(&turned), n_modes)
}
