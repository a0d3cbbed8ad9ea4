//! Lookup in the cells of a volume, as a shader would do it for an object that moves.

use crate::volume::{Validity, Volume};
use glam::Vec3;
use localprt_formats::sh;

/// Most outputs per cell.
const MOST_OUTPUTS: usize = 9;

/// Light of one relight in the cells of a volume.
#[derive(Clone, Copy, Debug)]
pub struct VolumeSampler<'a> {
    volume: &'a Volume<'a>,
    cells: &'a [Vec3],
}

impl<'a> VolumeSampler<'a> {
    /// Of `[n_cells, n_k]` coefficients.
    ///
    /// # Panics
    /// If the array does not have the length of the file.
    pub fn new(volume: &'a Volume<'a>, cells: &'a [Vec3]) -> Self {
        assert_eq!(cells.len(), volume.n_cells() * volume.n_k());
        Self { volume, cells }
    }

    /// Coefficients of the incident radiance at a place, the first n_k of the array: trilinear between the valid cells of
    /// the eight around it, with the weights divided by their sum. Where none of these is valid, the filled ones take
    /// their place; `None` where there is none of those either. Places outside of the grid count as on its border.
    pub fn radiance_at(&self, position: Vec3) -> Option<[Vec3; MOST_OUTPUTS]> {
        [Validity::Valid, Validity::Filled].into_iter().find_map(|validity| self.mean_of(position, validity))
    }

    /// Irradiance about a unit normal at a place, W m^-2, not negative; `None` as in [`VolumeSampler::radiance_at`].
    ///
    /// The convolution with the clamped cosine of Ramamoorthi and Hanrahan (2001).
    pub fn irradiance_at(&self, position: Vec3, normal: Vec3) -> Option<Vec3> {
        let radiance = self.radiance_at(position)?;
        let weights = sh::irradiance_weights_degree_2(normal.to_array());
        let sum = radiance[..self.volume.n_k()]
            .iter()
            .zip(weights)
            .fold(Vec3::ZERO, |sum, (&value, weight)| sum + weight * value);
        Some(sum.max(Vec3::ZERO))
    }

    /// The trilinear mean over cells of one validity.
    fn mean_of(&self, position: Vec3, wanted: Validity) -> Option<[Vec3; MOST_OUTPUTS]> {
        let grid = self.volume.grid();
        let n_k = self.volume.n_k();
        let last = Vec3::from(grid.dims.map(|dim| (dim - 1) as f32));
        // NaN becomes the first cell.
        let at = ((position - Vec3::from(grid.origin)) / grid.spacing_m).max(Vec3::ZERO).min(last);
        let base = at.floor();
        let fraction = at - base;
        let mut sums = [Vec3::ZERO; MOST_OUTPUTS];
        let mut total = 0.0;
        for corner in 0..8u32 {
            let step = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f32 =
                (0..3).map(|axis| if step[axis] == 0 { 1.0 - fraction[axis] } else { fraction[axis] }).product();
            // On the last cell of an axis there is no next one, and no weight for it.
            if weight <= 0.0 {
                continue;
            }
            let cell = grid.index([0, 1, 2].map(|axis| base[axis] as u32 + step[axis]));
            if self.volume.validity()[cell] == wanted {
                total += weight;
                let values = &self.cells[cell * n_k..][..n_k];
                sums.iter_mut().zip(values).for_each(|(sum, &value)| *sum += weight * value);
            }
        }
        (total > 0.0).then(|| sums.map(|sum| sum / total))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_bake;
    use std::f32::consts::PI;

    /// Cell c of the 2 x 2 x 2 cells holds radiance c + 1 from everywhere, in all bands.
    fn constants(n_k: usize) -> Vec<Vec3> {
        (0..8 * n_k)
            .map(
                |index| {
                    if index % n_k == 0 {
                        Vec3::splat((4.0 * PI).sqrt() * (index / n_k + 1) as f32)
                    } else {
                        Vec3::ZERO
                    }
                },
            )
            .collect()
    }

    #[test]
    fn only_valid_cells_count_and_their_weights_add_up_to_one() {
        for degree in [1, 2] {
            let arrays = test_bake::furnace_volume(0, degree);
            let volume = Volume::of(&arrays.checked().unwrap()).unwrap();
            let cells = constants(volume.n_k());
            let sampler = VolumeSampler::new(&volume, &cells);
            let corner = Vec3::new(-1.0, 0.0, 1.0);
            let at = |x: f32, y: f32, z: f32| {
                sampler.irradiance_at(corner + Vec3::new(x, y, z), Vec3::Y).map(|value| value.x / PI)
            };
            let near = |found: Option<f32>, expected: f32| {
                assert!((found.unwrap() - expected).abs() < 1e-5, "{found:?} {expected}");
            };
            // On valid cells, between two, and in the middle of cells 1 to 6 (0 is filled, 7 empty).
            near(at(1.0, 0.0, 0.0), 2.0);
            near(at(0.25, 0.0, 1.0), 0.75 * 5.0 + 0.25 * 6.0);
            near(at(0.5, 0.5, 0.5), (2.0 + 3.0 + 4.0 + 5.0 + 6.0 + 7.0) / 6.0);
            // Beside the filled cell the valid one counts alone; on it, it stands in.
            near(at(0.125, 0.0, 0.0), 2.0);
            near(at(0.0, 0.0, 0.0), 1.0);
            // The empty cell is dark only where it is alone, and then says so.
            near(at(0.75, 1.0, 1.0), 7.0);
            assert_eq!(at(1.0, 1.0, 1.0), None);
            // Outside is the border.
            near(at(9.0, -3.0, -1.0), 2.0);
            near(at(-5.0, 2.0, 0.0), 3.0);
        }
    }

    #[test]
    fn the_side_that_light_comes_from_is_brighter() {
        let arrays = test_bake::furnace_volume(0, 2);
        let volume = Volume::of(&arrays.checked().unwrap()).unwrap();
        let mut cells = vec![Vec3::ZERO; 72];
        // Radiance 1 + x in cell 1: pi + 2 pi / 3 about +x, pi - 2 pi / 3 about -x, pi about y.
        cells[9] = Vec3::splat((4.0 * PI).sqrt());
        cells[12] = Vec3::splat((4.0 * PI / 3.0).sqrt());
        let sampler = VolumeSampler::new(&volume, &cells);
        for (normal, expected) in [(Vec3::X, 5.0 / 3.0), (Vec3::NEG_X, 1.0 / 3.0), (Vec3::Y, 1.0)] {
            let found = sampler.irradiance_at(Vec3::new(0.0, 0.0, 1.0), normal).unwrap();
            assert!((found / PI - expected).abs().max_element() < 1e-5, "{normal}: {found}");
        }
    }
}
