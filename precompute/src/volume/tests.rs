//! Grids over boxes, and cells in and behind walls.

use super::*;
use crate::{settings::BakeSettings, voxels};
use localprt_scenes::builtin;

#[test]
fn a_grid_covers_its_box_and_no_more_than_a_spacing_beyond() {
    for (size, spacing_m) in [(Vec3::new(2.0, 1.0, 0.3), 0.2), (Vec3::new(7.3, 0.0, 1e-3), 0.7), (Vec3::ONE, 9.0)] {
        let (low, high) = (Vec3::new(-1.0, 5.0, 0.5), Vec3::new(-1.0, 5.0, 0.5) + size);
        let grid = grid((low, high), spacing_m, 1).expect("few cells");
        let last = Vec3::from(grid.position(grid.n_cells() as usize - 1));
        let first = Vec3::from(grid.origin);
        // A rounding of coordinates up to 10 m.
        let rounding = 2e-5 * spacing_m + 2e-6;
        assert!((first - low).max_element() <= rounding && (high - last).max_element() <= rounding, "{grid:?}");
        assert!((low - first).max_element() <= 0.5 * spacing_m + rounding, "{grid:?}");
        assert!(((low - first) - (last - high)).abs().max_element() <= 4e-6, "centered: {grid:?}");
    }
    // 2 m at 0.2 m are 11 cells, although 0.2 is not a binary number.
    assert_eq!(grid((Vec3::ZERO, Vec3::splat(2.0)), 0.2, 1).expect("few cells").dims, [11; 3]);
    assert_eq!(grid((Vec3::ZERO, Vec3::ZERO), 0.2, 1).expect("one cell").dims, [1; 3]);
}

#[test]
fn too_many_cells_are_refused() {
    let spacing_m = 1.0;
    assert!(grid((Vec3::ZERO, Vec3::new(255.0, 255.0, 63.0)), spacing_m, 1).is_ok());
    let error = grid((Vec3::ZERO, Vec3::new(255.0, 255.0, 64.0)), spacing_m, 1).expect_err("too many");
    assert_eq!(error.cells, 256.0 * 256.0 * 65.0);
    assert!(grid((Vec3::splat(-1e30), Vec3::splat(1e30)), 1e-3, 1).is_err());
    assert!(grid((Vec3::ZERO, Vec3::INFINITY), 1.0, 1).is_err());
}

#[test]
fn cells_inside_walls_take_the_nearest_in_the_open() {
    // A closed box seen from inside: its walls, and what lies behind them, are not in the open.
    let scene = builtin::scene("furnace").expect("a built-in scene");
    let bounds = scene.bounds().expect("a box");
    let caster = RayCaster::new(&scene).expect("tree");
    let rho = voxels::spacing(bounds, &BakeSettings::default());
    let voxels = VoxelGrid::build(&scene, &caster, rho, f32::INFINITY, &BakeSettings::default()).expect("voxels");
    let spacing_m = (bounds.1 - bounds.0).max_element() / 8.0;
    let found = cells(grid(bounds, spacing_m, 1).expect("few cells"), &voxels, &caster);
    let is_inside = |cell: u32| {
        let at = found.grid.coordinates(cell as usize);
        (0..3).all(|axis| at[axis] > 0 && at[axis] + 1 < found.grid.dims[axis])
    };
    let expected: Vec<u32> = (0..found.grid.n_cells() as u32).filter(|&cell| is_inside(cell)).collect();
    assert_eq!(found.cells, expected);
    assert_eq!(found.positions.len(), expected.len());
    assert_eq!(found.fill.len() + expected.len(), found.grid.n_cells() as usize);
    for &[cell, source] in &found.fill {
        assert!(!is_inside(cell) && is_inside(source));
        let [at, from] = [cell, source].map(|cell| found.grid.coordinates(cell as usize));
        // The next cell along every axis on which it is outside.
        for axis in 0..3 {
            assert_eq!(from[axis], at[axis].clamp(1, found.grid.dims[axis] - 2), "{at:?} {from:?}");
        }
    }
}

#[test]
fn fills_prefer_near_cells_and_reach_three_spacings() {
    let steps = nearest_first();
    assert_eq!(steps.len(), 122);
    assert_eq!(steps[0], [0, 0, -1]);
    assert!(steps.contains(&[3, 0, 0]) && steps.contains(&[2, 2, 1]) && !steps.contains(&[2, 2, 2]));
}
