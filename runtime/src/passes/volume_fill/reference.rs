//! CPU twin of the volume fill.

use crate::volume::Volume;
use glam::Vec3;

/// Writes every volume receiver's coefficients into its cell, then into the cells that take their values from it.
///
/// Cells that hold nothing are not written: they stay at what they were, which is 0 in the relighter.
///
/// # Panics
/// If the arrays do not have the lengths of the file.
pub fn volume_fill(volume: &Volume<'_>, coefficients: &[Vec3], cells: &mut [Vec3]) {
    let n_k = volume.n_k();
    let view = volume.view();
    assert_eq!(coefficients.len(), view.cells.len() * n_k);
    assert_eq!(cells.len(), volume.n_cells() * n_k);
    for (&cell, values) in view.cells.iter().zip(coefficients.chunks_exact(n_k)) {
        cells[cell as usize * n_k..][..n_k].copy_from_slice(values);
    }
    for &[cell, source] in view.fill {
        let source = source as usize * n_k;
        cells.copy_within(source..source + n_k, cell as usize * n_k);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_bake;

    #[test]
    fn cells_take_their_receiver_or_the_cell_they_are_filled_from() {
        let arrays = test_bake::furnace_volume(0, 1);
        let volume = Volume::of(&arrays.checked().unwrap()).unwrap();
        let coefficients: Vec<Vec3> = (0..24).map(|index| Vec3::new(index as f32, 1.0, 2.0)).collect();
        let mut cells = vec![Vec3::ZERO; 32];
        volume_fill(&volume, &coefficients, &mut cells);
        // Receivers stand in the cells 2, 1, 6, 3, 4, 5; cell 0 takes cell 4, which is receiver 4; cell 7 holds nothing.
        for (cell, receiver) in [(0, 4), (1, 1), (2, 0), (3, 3), (4, 4), (5, 5), (6, 2)] {
            assert_eq!(cells[4 * cell..4 * cell + 4], coefficients[4 * receiver..4 * receiver + 4], "cell {cell}");
        }
        assert_eq!(cells[28..], [Vec3::ZERO; 4]);
    }
}
