//! A cluster's transport rows to projection `S V^T` and reconstruction `U`, both in f16 (Eq. 11).

pub mod svd;

use half::f16;
use svd::{TruncatedSvd, residual_by_row, row_product, transposed_product};

/// The two stored factors of a cluster.
#[derive(Clone, Debug, Default)]
pub struct CompressedRows {
    /// Kept singular values, n_c.
    pub n_coefficients: usize,
    /// `[n_c][n_columns]`.
    pub projection: Vec<f16>,
    /// `[n_rows][n_c]`.
    pub reconstruction: Vec<f16>,
    /// Squared error of each row, after rounding to f16.
    pub row_error_squared: Vec<f64>,
}

impl CompressedRows {
    /// Nothing kept: the rows are the error.
    pub fn none(rows: &[f32], n_rows: usize, n_columns: usize) -> Self {
        let row_error_squared =
            if n_columns == 0 { vec![0.0; n_rows] } else { residual_by_row(rows, &[], &[], 0, n_columns) };
        Self { row_error_squared, ..Self::default() }
    }

    /// Root mean square over rows of the error of a row.
    pub fn rms(&self) -> f64 {
        (self.row_error_squared.iter().sum::<f64>() / self.row_error_squared.len().max(1) as f64).sqrt()
    }
}

/// Smallest rank whose dropped energy is within `allowed_squared`; `None` if the decomposition's own rank is too small.
pub fn least_rank(svd: &TruncatedSvd, allowed_squared: f64) -> Option<usize> {
    let mut left = svd.norm_squared;
    if left <= allowed_squared {
        return Some(0);
    }
    for (index, sigma_squared) in svd.sigma_squared.iter().enumerate() {
        left -= sigma_squared;
        if left <= allowed_squared {
            return Some(index + 1);
        }
    }
    None
}

/// Keeps the first `n_c` singular values and rounds both factors to f16.
pub fn compress(rows: &[f32], svd: &TruncatedSvd, n_c: usize) -> CompressedRows {
    let reconstruction: Vec<f16> = svd
        .u
        .chunks_exact(svd.rank.max(1))
        .flat_map(|row| row[..n_c].iter().map(|&value| f16::from_f32(value)))
        .collect();
    let projection: Vec<f16> = svd.p[..n_c * svd.n_columns].iter().map(|&value| f16::from_f32(value)).collect();
    let u: Vec<f32> = reconstruction.iter().map(|value| value.to_f32()).collect();
    let p: Vec<f32> = projection.iter().map(|value| value.to_f32()).collect();
    let row_error_squared = residual_by_row(rows, &u, &p, n_c, svd.n_columns);
    CompressedRows { n_coefficients: n_c, projection, reconstruction, row_error_squared }
}

/// The same where errors are measured by `metric`, W `[n_columns][n]`: `svd` is that of the `weighted` rows T W, and the
/// projection of the rows themselves onto its first `n_c` left singular vectors, `U^T T`, is what makes the error least.
pub fn compress_weighted(
    rows: &[f32],
    weighted: &[f32],
    metric: &[f32],
    svd: &TruncatedSvd,
    n_c: usize,
) -> CompressedRows {
    let n_columns = rows.len() / svd.n_rows.max(1);
    let kept: Vec<f32> = svd.u.chunks_exact(svd.rank.max(1)).flat_map(|row| row[..n_c].iter().copied()).collect();
    let projection: Vec<f16> =
        transposed_product(&kept, n_c, rows, n_columns).iter().map(|&value| f16::from_f32(value)).collect();
    let reconstruction: Vec<f16> = kept.iter().map(|&value| f16::from_f32(value)).collect();
    let u: Vec<f32> = reconstruction.iter().map(|value| value.to_f32()).collect();
    let p: Vec<f32> = projection.iter().map(|value| value.to_f32()).collect();
    let p = row_product(&p, n_columns, metric, svd.n_columns);
    let row_error_squared = residual_by_row(weighted, &u, &p, n_c, svd.n_columns);
    CompressedRows { n_coefficients: n_c, projection, reconstruction, row_error_squared }
}
