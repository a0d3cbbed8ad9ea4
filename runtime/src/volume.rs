//! The cells of a baked volume: where they lie, and which of them hold light.

use localprt_formats::{Checked, VolumeGrid, VolumeView};

/// What a cell of a volume holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Validity {
    /// Nothing: the cell lies inside or behind geometry, and no valid one is near.
    #[default]
    Empty = 0,
    /// The values of a valid cell near by.
    Filled = 1,
    /// Values of its own.
    Valid = 2,
}

/// Cells of a volume.
#[derive(Clone, Debug)]
pub struct Volume<'a> {
    view: VolumeView<'a>,
    validity: Vec<Validity>,
}

impl<'a> Volume<'a> {
    /// That of a file; `None` if it has none.
    pub fn of(baked: &Checked<'a>) -> Option<Self> {
        let view = baked.view().volume?;
        let mut validity = vec![Validity::Empty; view.grid.n_cells() as usize];
        view.cells.iter().for_each(|&cell| validity[cell as usize] = Validity::Valid);
        view.fill.iter().for_each(|&[cell, _]| validity[cell as usize] = Validity::Filled);
        Some(Self { view, validity })
    }

    /// The arrays of the file.
    pub fn view(&self) -> &VolumeView<'a> {
        &self.view
    }

    /// Where the cells lie.
    pub fn grid(&self) -> &'a VolumeGrid {
        self.view.grid
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.validity.len()
    }

    /// Outputs per cell: 4 or 9.
    pub fn n_k(&self) -> usize {
        self.view.grid.n_k()
    }

    /// `[n_cells]` what each cell holds.
    pub fn validity(&self) -> &[Validity] {
        &self.validity
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_bake;

    #[test]
    fn cells_are_valid_filled_or_empty() {
        let arrays = test_bake::furnace_volume(0, 2);
        let volume = Volume::of(&arrays.checked().unwrap()).unwrap();
        assert_eq!((volume.n_cells(), volume.n_k()), (8, 9));
        let codes: Vec<u8> = volume.validity().iter().map(|&validity| validity as u8).collect();
        assert_eq!(codes, [1, 2, 2, 2, 2, 2, 2, 0]);
    }
}
