//! Morton curves: the bits of coordinates in turn, so that what follows each other on the curve lies close in space.

/// Place of a cell of the plane, 14 bits an axis.
pub(crate) fn of_plane([x, y]: [u32; 2]) -> u32 {
    spread::<2>(x, 14) | spread::<2>(y, 14) << 1
}

/// The cell of the plane at a place.
pub(crate) fn to_plane(place: u32) -> [u32; 2] {
    [place, place >> 1].map(|bits| (0..14).fold(0, |cell, bit| cell | (bits >> (2 * bit) & 1) << bit))
}

/// Place of a cell of space, 10 bits an axis.
pub(crate) fn of_space([x, y, z]: [u32; 3]) -> u32 {
    spread::<3>(x, 10) | spread::<3>(y, 10) << 1 | spread::<3>(z, 10) << 2
}

/// The bits of a coordinate, `STEP` apart.
fn spread<const STEP: u32>(cell: u32, bits: u32) -> u32 {
    (0..bits).fold(0, |place, bit| place | (cell >> bit & 1) << (STEP * bit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::counter_hash;

    #[test]
    fn places_in_the_plane_are_cells() {
        for i in 0..1000 {
            let cell = [0, 1].map(|axis| counter_hash(1, axis, i) as u32 % (1 << 14));
            assert_eq!(to_plane(of_plane(cell)), cell);
        }
        assert_eq!([[1, 0], [0, 1], [1, 1], [2, 0]].map(of_plane), [1, 2, 3, 4]);
    }

    #[test]
    fn a_cube_of_cells_follows_itself() {
        let cube = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1], [2, 0, 0]];
        assert_eq!(cube.map(of_space), [0, 1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(of_space([1023; 3]), (1 << 30) - 1);
    }
}
