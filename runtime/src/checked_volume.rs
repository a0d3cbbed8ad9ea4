//! The volume of a baked file, checked once: a grid in the open space, and the transport to its cells.

use crate::checked_bake::{Transport, ensure, fail};
use crate::error::RelightError;
use localprt_formats::check::{MAX_VOLUME_CELLS, MAX_VOLUME_DEGREE};
use localprt_formats::{BakedView, VolumeGrid, VolumeView};

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

/// A volume with checked structure.
#[derive(Clone, Debug)]
pub struct CheckedVolume<'a> {
    view: VolumeView<'a>,
    transport: Transport<'a>,
    validity: Vec<Validity>,
}

impl<'a> CheckedVolume<'a> {
    pub(crate) fn new(view: &BakedView<'a>, volume: VolumeView<'a>) -> Result<Self, RelightError> {
        let VolumeGrid { degree, dims, .. } = *volume.grid;
        ensure((1..=MAX_VOLUME_DEGREE).contains(&degree), "volume", || {
            format!("degree is {degree}, must lie in 1..={MAX_VOLUME_DEGREE}")
        })?;
        let n_cells = volume.grid.n_cells();
        ensure((1..=MAX_VOLUME_CELLS).contains(&n_cells), "volume", || {
            format!("{dims:?} are {n_cells} cells, allowed are 1 to {MAX_VOLUME_CELLS}")
        })?;
        let mut validity = vec![Validity::Empty; n_cells as usize];
        for &cell in volume.cells {
            match validity.get_mut(cell as usize) {
                Some(validity) => *validity = Validity::Valid,
                None => return fail("volume cells", format!("cell {cell} does not exist, there are {n_cells}")),
            }
        }
        for &[cell, source] in volume.fill {
            let [target, from] = [cell, source].map(|cell| validity.get(cell as usize).copied());
            ensure(
                from == Some(Validity::Valid) && target.is_some_and(|target| target != Validity::Valid),
                "volume fill",
                || format!("cell {cell} cannot take the values of cell {source}"),
            )?;
            validity[cell as usize] = Validity::Filled;
        }
        Ok(Self { transport: Transport::of_volume(view, &volume)?, view: volume, validity })
    }

    /// The arrays of the file.
    pub fn view(&self) -> &VolumeView<'a> {
        &self.view
    }

    /// Where the cells lie.
    pub fn grid(&self) -> &VolumeGrid {
        self.view.grid
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.validity.len()
    }

    /// Outputs per cell: 4 or 9.
    pub fn n_k(&self) -> usize {
        self.transport.n_k
    }

    /// Transport from probes and sky to the valid cells, in the order of `view().cells`.
    pub fn transport(&self) -> &Transport<'a> {
        &self.transport
    }

    /// `[n_cells]` what each cell holds.
    pub fn validity(&self) -> &[Validity] {
        &self.validity
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checked_bake::CheckedBake;
    use crate::test_bake;
    use localprt_formats::VolumeArrays;

    #[track_caller]
    fn assert_refused(expected_place: &str, change: impl FnOnce(&mut VolumeArrays)) {
        let mut arrays = test_bake::furnace_volume(1, 1);
        assert!(CheckedBake::new(arrays.view()).is_ok());
        change(arrays.volume.as_mut().unwrap());
        match CheckedBake::new(arrays.view()) {
            Err(RelightError::Bake { place, problem }) => assert_eq!(place, expected_place, "{problem}"),
            other => panic!("{expected_place}: {other:?}"),
        }
    }

    #[test]
    fn contradicting_volumes_are_refused_by_name() {
        assert_refused("volume", |v| v.grid.degree = 0);
        assert_refused("volume", |v| v.grid.degree = u32::MAX);
        assert_refused("volume", |v| v.grid.dims = [0, 1, 1]);
        assert_refused("volume", |v| v.grid.dims = [u32::MAX; 3]);
        assert_refused("volume cells", |v| v.cells[0] = 8);
        assert_refused("volume fill", |v| v.fill[0][0] = 8);
        assert_refused("volume fill", |v| v.fill[0][1] = 8);
        assert_refused("volume fill", |v| v.fill[0][1] = v.fill[0][0]);
        assert_refused("volume fill", |v| v.fill[0][0] = v.cells[1]);
        // Degree 2 needs more rows than degree 1 has.
        assert_refused("volume cluster 0", |v| v.grid.degree = 2);
        assert_refused("volume cluster 0", |v| v.clusters[0].n_receivers = 7);
        assert_refused("volume cluster_probes", |v| v.cluster_probes[0] = 2);
    }

    #[test]
    fn cells_are_valid_filled_or_empty() {
        let arrays = test_bake::furnace_volume(0, 2);
        let baked = CheckedBake::new(arrays.view()).unwrap();
        let volume = baked.volume().unwrap();
        assert_eq!((volume.n_cells(), volume.n_k(), volume.transport().n_receivers), (8, 9, 6));
        let codes: Vec<u8> = volume.validity().iter().map(|&validity| validity as u8).collect();
        assert_eq!(codes, [1, 2, 2, 2, 2, 2, 2, 0]);
    }
}
