use super::{
    MAX_VOXELS, Voxel, VoxelError, VoxelGrid, grid_points, rasterize,
    rasterize::Triangle,
    spacing, spacing_for,
    test_scenes::{block, flipped, rectangle, room, scene, sphere},
};
use crate::{rays::RayCaster, settings::BakeSettings};
use glam::{DVec3, UVec3, Vec3};
use localprt_formats::directions::counter_uniform;
use localprt_scenes::Scene;

fn build(scene: &Scene, settings: &BakeSettings) -> Result<VoxelGrid, VoxelError> {
    let caster = RayCaster::new(scene).unwrap();
    VoxelGrid::build(scene, &caster, spacing(scene.bounds().unwrap_or_default(), settings), f32::INFINITY, settings)
}

fn with_voxel(voxel: f32) -> BakeSettings {
    BakeSettings { voxel: Some(voxel), ..Default::default() }
}

/// A point of a triangle or box for a fuzz test: uniform in `[-scale, scale]^3`.
fn random(stream: u64, counter: u64, scale: f64) -> DVec3 {
    DVec3::from([0, 1, 2].map(|axis| scale * (2.0 * counter_uniform(7, stream, 3 * counter + axis) - 1.0)))
}

/// Triangle clipped to a box by its six planes (Sutherland-Hodgman): another way to the same answer.
fn clipped_is_empty(corners: [DVec3; 3], low: DVec3, high: DVec3) -> bool {
    let mut polygon = corners.to_vec();
    for axis in 0..3 {
        for (bound, sign) in [(low[axis], 1.0), (high[axis], -1.0)] {
            let inside = |point: DVec3| sign * (point[axis] - bound);
            let mut clipped = Vec::new();
            for index in 0..polygon.len() {
                let (a, b) = (polygon[index], polygon[(index + 1) % polygon.len()]);
                let (da, db) = (inside(a), inside(b));
                if da >= 0.0 {
                    clipped.push(a);
                }
                if (da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0) {
                    clipped.push(a + (b - a) * (da / (da - db)));
                }
            }
            polygon = clipped;
        }
    }
    polygon.is_empty()
}

#[test]
fn overlap_agrees_with_clipping() {
    let (mut apart, mut touching) = (0, 0);
    for case in 0..20_000u64 {
        let corners = [0, 1, 2].map(|corner| random(corner, case, 2.0));
        // One in four is axis-aligned, one in four a needle.
        let corners = match case % 4 {
            0 => corners.map(|corner| DVec3::new(corner.x, corner.y, 0.3)),
            1 => [corners[0], corners[1], corners[1] + 1e-4 * corners[2]],
            _ => corners,
        };
        let half = DVec3::new(0.5, 0.7, 0.3);
        let overlaps = Triangle::new(corners).overlaps(DVec3::ZERO, half);
        let empty = clipped_is_empty(corners, -half, half);
        // Within the margin of 1e-7 both answers are right; random cases do not come that near, and one that does
        // shows here as a disagreement of the wider box as well.
        if overlaps == empty {
            assert!(overlaps && !clipped_is_empty(corners, -half - 2e-7, half + 2e-7), "case {case}: {corners:?}");
        }
        *(if empty { &mut apart } else { &mut touching }) += 1;
    }
    assert!(apart > 3000 && touching > 3000, "one-sided test: {apart} apart, {touching} touching");
}

#[test]
fn every_point_of_a_surface_is_in_a_solid_voxel_and_every_solid_voxel_touches_it() {
    let triangles =
        [sphere(Vec3::new(0.3, -0.2, 0.1), 1.0, 3), rectangle(Vec3::NEG_ONE, Vec3::X, Vec3::Z * 2.0)].concat();
    let scene = scene(std::slice::from_ref(&triangles), false);
    let (origin, voxel_m, size) = (Vec3::splat(-1.7), 0.13f32, UVec3::splat(30));
    let solid = rasterize::solid_voxels(&scene, origin, voxel_m, size);
    let grid = VoxelGrid { origin, voxel_m, size, voxels: Vec::new() };
    let voxel = f64::from(voxel_m);
    for corners in &triangles {
        let [a, b, c] = corners.map(|corner| (corner.as_dvec3() - origin.as_dvec3()) / voxel);
        for i in 0..=24 {
            for j in 0..=24 - i {
                let point = a + (b - a) * (f64::from(i) / 24.0) + (c - a) * (f64::from(j) / 24.0);
                assert!(solid[grid.index(point.floor().as_uvec3())], "{point} of {corners:?}");
            }
        }
    }
    let count = solid.iter().filter(|&&solid| solid).count();
    for (index, &solid) in solid.iter().enumerate() {
        let low = origin.as_dvec3() + grid.cell(index).as_dvec3() * voxel;
        let touched = triangles.iter().any(|corners| {
            !clipped_is_empty(corners.map(Vec3::as_dvec3), low - 1e-6 * voxel, low + voxel * (1.0 + 1e-6))
        });
        // The two boxes differ by the margins alone, and only toward more touching.
        assert!(touched || !solid, "voxel {} is solid without a triangle", grid.cell(index));
    }
    // A sphere's shell: area over voxel area is 744; conservative voxels are 1.5 to 2.5 times as many.
    assert!((1100..2200).contains(&count), "{count} solid voxels");
}

#[test]
fn a_closed_wall_is_not_crossed() {
    // Two rooms whose common wall is one slanted sheet, thinner than any voxel.
    let slanted = rectangle(Vec3::new(1.7, 0.0, 0.0), Vec3::new(0.6, 0.0, 2.0), Vec3::Y * 2.0);
    let parts = [room(Vec3::ZERO, Vec3::new(4.0, 2.0, 2.0)), slanted];
    let settings = BakeSettings { interior: vec![[0.5, 1.0, 1.0]], ..with_voxel(0.11) };
    let grid = build(&scene(&parts, true), &settings).unwrap();
    assert_eq!(grid.at(Vec3::new(0.5, 1.0, 1.0)), Some(Voxel::Open));
    assert_eq!(grid.at(Vec3::new(3.5, 1.0, 1.0)), Some(Voxel::Enclosed));
    for (index, &voxel) in grid.voxels.iter().enumerate() {
        let center = grid.center(grid.cell(index));
        let beyond = center.x > 1.7 + 0.3 * center.z;
        assert!(!(voxel == Voxel::Open && beyond), "leak at {center}");
    }
}

#[test]
fn the_inside_of_a_block_and_the_outside_of_a_room_are_enclosed() {
    let parts = [room(Vec3::ZERO, Vec3::splat(4.0)), block(Vec3::splat(1.0), Vec3::splat(2.5))];
    let grid = build(&scene(&parts, false), &with_voxel(0.2)).unwrap();
    assert_eq!(grid.at(Vec3::splat(0.5)), Some(Voxel::Open));
    assert_eq!(grid.at(Vec3::splat(3.3)), Some(Voxel::Open));
    assert_eq!(grid.at(Vec3::splat(1.75)), Some(Voxel::Enclosed));
    assert_eq!(grid.at(Vec3::splat(-0.3)), Some(Voxel::Enclosed));
    assert_eq!(grid.at(Vec3::splat(0.01)), Some(Voxel::Solid));
    assert_eq!(grid.at(Vec3::splat(40.0)), None);
}

#[test]
fn a_sphere_is_open_on_the_side_its_fronts_look_to() {
    let shell = sphere(Vec3::ZERO, 1.0, 3);
    let out = build(&scene(std::slice::from_ref(&shell), false), &with_voxel(0.1)).unwrap();
    let inward = build(&scene(&[flipped(&shell)], false), &with_voxel(0.1)).unwrap();
    let both = build(&scene(&[shell], true), &with_voxel(0.1)).unwrap();
    let (inside, outside) = (Vec3::ZERO, Vec3::splat(0.95));
    assert_eq!((out.at(inside), out.at(outside)), (Some(Voxel::Enclosed), Some(Voxel::Open)));
    assert_eq!((inward.at(inside), inward.at(outside)), (Some(Voxel::Open), Some(Voxel::Enclosed)));
    // Double-sided surfaces have no back, so winding tells nothing.
    assert_eq!((both.at(inside), both.at(outside)), (Some(Voxel::Open), Some(Voxel::Open)));
}

#[test]
fn an_open_plane_has_open_space_above() {
    let ground = rectangle(Vec3::ZERO, Vec3::Z * 100.0, Vec3::X * 100.0);
    let grid = build(&scene(&[ground], false), &BakeSettings::default()).unwrap();
    assert_eq!(grid.at(Vec3::new(50.0, grid.voxel_m, 50.0)), Some(Voxel::Open));
    assert_eq!(grid.at(Vec3::new(50.0, 0.0, 50.0)), Some(Voxel::Solid));
    assert_eq!(grid.size.y, 5);
}

#[test]
fn interior_points_choose_the_space_or_are_refused() {
    let parts = [room(Vec3::ZERO, Vec3::splat(2.0)), room(Vec3::X * 3.0, Vec3::new(5.0, 2.0, 2.0))];
    let scene = scene(&parts, false);
    let at = |points: &[[f32; 3]]| build(&scene, &BakeSettings { interior: points.to_vec(), ..with_voxel(0.1) });
    let grid = at(&[[4.0, 1.0, 1.0]]).unwrap();
    assert_eq!(grid.at(Vec3::ONE), Some(Voxel::Enclosed));
    assert_eq!(grid.at(Vec3::new(4.0, 1.0, 1.0)), Some(Voxel::Open));
    // In a solid voxel, but on the room's side of the wall.
    let grid = at(&[[1.0, 0.01, 1.0]]).unwrap();
    assert_eq!(grid.at(Vec3::ONE), Some(Voxel::Open));
    assert_eq!(grid.at(Vec3::splat(-0.15)), Some(Voxel::Enclosed));
    assert!(matches!(at(&[[1.0; 3], [9.0, 1.0, 1.0]]), Err(VoxelError::InteriorOutside { index: 1, .. })));
    assert!(matches!(at(&[[f32::NAN; 3]]), Err(VoxelError::InteriorOutside { index: 0, .. })));
    let stack: Vec<_> =
        (0..9).flat_map(|i| block(Vec3::splat(0.1 * i as f32), Vec3::splat(2.0 - 0.1 * i as f32))).collect();
    let solid = build(
        &super::test_scenes::scene(&[stack], false),
        &BakeSettings { interior: vec![[0.45, 1.0, 1.0]], ..with_voxel(0.2) },
    );
    assert!(matches!(solid, Err(VoxelError::InteriorSolid { index: 0, .. })), "{:?}", solid.map(|grid| grid.size));
}

#[test]
fn options_and_scenes_that_cannot_work_are_refused() {
    let room = scene(&[room(Vec3::ZERO, Vec3::splat(2.0))], false);
    assert_eq!(build(&scene(&[], false), &BakeSettings::default()).unwrap_err(), VoxelError::EmptyScene);
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let error = build(&room, &with_voxel(bad)).unwrap_err();
        assert!(matches!(error, VoxelError::InvalidLength { option: "voxel", .. }), "{error}");
        let error = build(&room, &BakeSettings { spacing: Some(bad), ..Default::default() }).unwrap_err();
        assert!(matches!(error, VoxelError::InvalidLength { option: "spacing", .. }), "{error}");
    }
    let Err(VoxelError::VoxelTooSmall { smallest_m, .. }) = build(&room, &with_voxel(1e-4)) else {
        panic!("a grid of 20 000 voxels per axis was accepted");
    };
    // 2 m in 400 voxels, padding included: 64 M.
    assert!((0.0049..0.0051).contains(&smallest_m), "{smallest_m}");
}

#[test]
fn the_size_an_error_names_is_accepted() {
    // A slab, so that the grid at the cap stays small enough for a test: cap by rounding, far from the origin.
    let offset = Vec3::X * 1e6;
    let far = scene(&[room(offset, offset + Vec3::splat(8.0))], false);
    let Err(VoxelError::VoxelTooSmall { smallest_m, .. }) = build(&far, &with_voxel(0.1)) else {
        panic!("voxels of 0.1 m a million metres out were accepted");
    };
    let grid = build(&far, &with_voxel(smallest_m)).unwrap();
    assert_eq!(grid.at(offset + Vec3::splat(4.0)), Some(Voxel::Open));
}

#[test]
fn a_tiny_spacing_does_not_pass_the_memory_cap() {
    // 1 mm spacing over 100 m by 100 m by 1 m.
    let extent = DVec3::new(100.0, 1.0, 100.0);
    let smallest = f64::from(super::smallest_voxel(extent, 100.0, MAX_VOXELS));
    let voxels = super::axis_voxels(extent, smallest).element_product();
    assert!(voxels <= MAX_VOXELS as f64 && voxels > 0.9 * MAX_VOXELS as f64, "{voxels}");
    let bounds = (Vec3::ZERO, extent.as_vec3());
    let size = super::voxel_size(bounds, 0.001, f32::INFINITY, &BakeSettings::default()).unwrap();
    assert_eq!(f64::from(size), smallest);
}

#[test]
fn default_spacing_gives_about_150_grid_points() {
    for extent in [
        Vec3::new(29.8, 12.5, 18.3),
        Vec3::ONE,
        Vec3::new(1e5, 1e5, 3e4),
        Vec3::new(1e-3, 2e-3, 1e-3),
        Vec3::new(7.0, 0.0, 5.0),
    ] {
        let bounds = (Vec3::splat(3.0) * extent, Vec3::splat(4.0) * extent);
        let rho = spacing(bounds, &BakeSettings::default());
        // The largest step is a cube's, from 125 to 216 points.
        let points = grid_points(bounds, rho);
        assert!((125.0..=180.0).contains(&points), "{extent}: {points} points at {rho} m");
    }
    let line = (Vec3::ZERO, Vec3::X * 10.0);
    for count in [1, 2, 3, 150, 1000] {
        assert_eq!(grid_points(line, spacing_for(line, count)), f64::from(count));
    }
    assert_eq!(grid_points((Vec3::ONE, Vec3::ONE), spacing_for((Vec3::ONE, Vec3::ONE), 5)), 1.0);
    let settings = BakeSettings { probes: Some(27), ..Default::default() };
    assert_eq!(grid_points((Vec3::ZERO, Vec3::ONE), spacing((Vec3::ZERO, Vec3::ONE), &settings)), 27.0);
    let settings = BakeSettings { spacing: Some(0.7), ..settings };
    assert_eq!(spacing((Vec3::ZERO, Vec3::ONE), &settings), 0.7);
}

#[test]
fn scale_and_place_do_not_matter() {
    let classify = |scale: f32, offset: Vec3| {
        let at = |x: f32| offset + Vec3::splat(x * scale);
        let grid =
            build(&scene(&[room(at(0.0), at(4.0)), block(at(1.0), at(2.5))], false), &BakeSettings::default()).unwrap();
        [0.5, 1.75, 3.3, -0.2].map(|x| grid.at(at(x)))
    };
    let expected = [Voxel::Open, Voxel::Enclosed, Voxel::Open, Voxel::Enclosed].map(Some);
    for (scale, offset) in [
        (1.0, Vec3::ZERO),
        (2.5e4, Vec3::ZERO),
        (2.5e-4, Vec3::ZERO),
        (1.0, Vec3::new(1e4, -2e4, 3e3)),
        (0.5, Vec3::splat(1e5)),
    ] {
        assert_eq!(classify(scale, offset), expected, "scale {scale}, offset {offset}");
    }
}

#[test]
fn threads_do_not_change_the_grid() {
    let parts = [room(Vec3::ZERO, Vec3::splat(4.0)), sphere(Vec3::splat(2.0), 1.1, 4)];
    let scene = scene(&parts, false);
    let grid = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build(&scene, &with_voxel(0.05)).unwrap())
    };
    assert!(grid(1).voxels == grid(4).voxels);
}
