use super::{
    Coverage, PlacementError, PlacementReport, ProbeSet, Support, candidates, place, reduce, support, target_count,
};
use crate::{
    rays::RayCaster,
    scale::LocalScale,
    settings::BakeSettings,
    voxels::{
        Voxel, VoxelGrid, spacing,
        test_scenes::{block, corridor, labyrinth, rectangle, room, scene, sphere, surface_points},
    },
};
use glam::Vec3;
use localprt_formats::directions::counter_uniform;
use localprt_scenes::Scene;

type Placed = (ProbeSet, Support, PlacementReport);

fn run(scene: &Scene, receivers: usize, settings: &BakeSettings) -> Result<Placed, PlacementError> {
    let caster = RayCaster::new(scene).unwrap();
    let rho = spacing(scene.bounds().unwrap(), settings);
    let grid = VoxelGrid::build(scene, &caster, rho, f32::INFINITY, settings).unwrap();
    let (points, normals) = surface_points(scene, receivers);
    place(&caster, &grid, rho, &LocalScale::uniform(), &points, &normals, settings, None)
}

fn exactly(probes: u32) -> BakeSettings {
    BakeSettings { probes: Some(probes), ..Default::default() }
}

fn two_rooms_with_blocks() -> Scene {
    let parts = [
        room(Vec3::ZERO, Vec3::new(4.0, 3.0, 5.0)),
        room(Vec3::X * 4.02, Vec3::new(9.0, 3.0, 5.0)),
        block(Vec3::new(1.0, 0.5, 1.0), Vec3::new(2.4, 1.8, 2.4)),
        sphere(Vec3::new(6.5, 1.5, 2.5), 0.9, 3),
    ];
    scene(&parts, false)
}

fn random_points(count: u64, scale: f32) -> Vec<Vec3> {
    let at = |point, axis| scale * counter_uniform(3, point, axis) as f32;
    (0..count).map(|point| Vec3::new(at(point, 0), at(point, 1), at(point, 2))).collect()
}

/// Distance of every point to its nearest other one.
fn nearest_other(points: &[Vec3]) -> Vec<f32> {
    let others = |own: usize| points.iter().enumerate().filter(move |&(other, _)| other != own);
    (0..points.len())
        .map(|own| others(own).map(|(_, other)| other.distance(points[own])).fold(f32::INFINITY, f32::min))
        .collect()
}

fn brute_force_support(receivers: &[Vec3], probes: &[Vec3], support: &Support) -> bool {
    receivers.iter().enumerate().all(|(receiver, position)| {
        let near = |&probe: &u32| probes[probe as usize].distance(*position) < support.radius_m[receiver];
        let expected: Vec<u32> = (0..probes.len() as u32).filter(near).collect();
        support.of(receiver) == expected
    })
}

#[test]
fn candidates_are_open_and_clear_of_surfaces() {
    let scene = two_rooms_with_blocks();
    let caster = RayCaster::new(&scene).unwrap();
    let settings = BakeSettings::default();
    let grid = VoxelGrid::build(&scene, &caster, spacing(scene.bounds().unwrap(), &settings), f32::INFINITY, &settings)
        .unwrap();
    let found = candidates(&grid, &caster, 150, 1, 0).unwrap();
    assert!(found.positions.len() > 2000, "{}", found.positions.len());
    for &position in &found.positions {
        assert_eq!(grid.at(position), Some(Voxel::Open), "{position}");
        let inside = |low: Vec3, high: Vec3| position.cmpgt(low).all() && position.cmplt(high).all();
        let rooms = inside(Vec3::ZERO, Vec3::new(4.0, 3.0, 5.0)) || inside(Vec3::X * 4.02, Vec3::new(9.0, 3.0, 5.0));
        assert!(rooms, "{position} is outside of the rooms");
        assert!(!inside(Vec3::new(1.0, 0.5, 1.0), Vec3::new(2.4, 1.8, 2.4)), "{position} is in the block");
        // The sphere's facets are at most 0.03 m inside of it.
        assert!(position.distance(Vec3::new(6.5, 1.5, 2.5)) > 0.87, "{position} is in the sphere");
        let cell = grid.cell_at(position).unwrap();
        assert!(
            grid.neighbors(cell).any(|other| grid.voxels[other] == Voxel::Solid),
            "{position} is not near a surface"
        );
    }
}

#[test]
fn behind_an_open_plane_there_is_no_candidate() {
    let ground = rectangle(Vec3::ZERO, Vec3::Z * 80.0, Vec3::X * 120.0);
    let (probes, support, report) = run(&scene(&[ground], false), 3000, &BakeSettings::default()).unwrap();
    assert!(probes.positions.iter().all(|position| position.y > 0.0));
    assert!(report.rejected > 0, "nothing below the plane was rejected");
    assert!((140..=160).contains(&probes.positions.len()), "{} probes", probes.positions.len());
    assert!((report.overlap.0 - 10.0).abs() <= 0.3 && report.overlap.1 >= 3, "{:?}", report.overlap);
    assert_eq!(support.start.len(), support.radius_m.len() + 1);
}

#[test]
fn too_few_surface_voxels_are_filled_up_from_the_open() {
    // Around 1300 voxels near the walls, 3600 in all.
    let scene = scene(&[room(Vec3::ZERO, Vec3::splat(1.6))], false);
    let caster = RayCaster::new(&scene).unwrap();
    let settings = BakeSettings { voxel: Some(0.1), ..exactly(2000) };
    let grid = VoxelGrid::build(&scene, &caster, 0.2, f32::INFINITY, &settings).unwrap();
    assert!(candidates(&grid, &caster, 1000, 1, 0).unwrap().positions.len() < 2000);
    let found = candidates(&grid, &caster, 2000, 1, 0).unwrap();
    assert!(found.positions.len() >= 2000, "{}", found.positions.len());
    let unique: std::collections::BTreeSet<_> =
        found.positions.iter().map(|p| p.to_array().map(f32::to_bits)).collect();
    assert_eq!(unique.len(), found.positions.len());
}

#[test]
fn reduction_removes_the_densest_first_and_ties_by_index() {
    // A tight triple and a pair: the middle of the triple is densest; then pairs tie and the lowest index goes.
    let points = [10.0, 0.0, 0.1, 0.2, 10.2].map(|x| Vec3::X * x);
    let reduction = reduce(&points, 2, 1.0);
    assert_eq!(reduction.removed, [2, 0, 1]);
    assert_eq!(reduction.kept, [3, 4]);
    assert_eq!(reduction.padded(3), [1, 3, 4]);
    assert_eq!(reduction.padded(99), [0, 1, 2, 3, 4]);
    assert_eq!(reduction.with(&[0]).kept, [0, 3, 4]);
    assert_eq!(reduction.with(&[0]).padded(4), [0, 1, 3, 4]);
    let thin = |indices: &[u32], count| {
        let left: Vec<Vec3> = indices.iter().map(|&index| points[index as usize]).collect();
        reduce(&left, count, 1.0)
    };
    assert_eq!(reduce(&points, 4, 1.0).further(2, thin), reduction);
    assert_eq!(reduce(&points, 9, 1.0).kept, [0, 1, 2, 3, 4]);
    assert_eq!(reduce(&[Vec3::ONE; 6], 1, 1.0).kept, [5]);
    assert_eq!(reduce(&[], 3, 1.0).kept, [] as [u32; 0]);
}

#[test]
fn reduction_agrees_with_removal_step_by_step() {
    let points = random_points(300, 1.0);
    let kernel_m = 0.25;
    let mut left: Vec<u32> = (0..300).collect();
    let mut removed = Vec::new();
    // Above the density 0, where the kernel would grow. Weights in the same integer steps, summed afresh each time.
    while left.len() > 60 {
        let density = |own: u32| -> u64 {
            let weight = |&other: &u32| {
                let distance = points[other as usize].distance(points[own as usize]);
                (localprt_formats::weight::weight_kernel(distance / kernel_m) * 4_294_967_296.0) as u64
            };
            left.iter().filter(|&&other| other != own).map(weight).sum()
        };
        let densest = *left.iter().max_by_key(|&&own| (density(own), std::cmp::Reverse(own))).unwrap();
        removed.push(densest);
        left.retain(|&other| other != densest);
    }
    let reduction = reduce(&points, 60, kernel_m);
    assert_eq!(reduction.removed, removed);
    assert_eq!(reduction.kept, left);
}

#[test]
fn thinning_a_lattice_or_a_line_ends_and_leaves_no_clumps() {
    let lattice: Vec<Vec3> =
        (0..1000).map(|index| Vec3::new((index % 10) as f32, (index / 10 % 10) as f32, (index / 100) as f32)).collect();
    for kernel_m in [0.3, 1.0, 1.01, 3.0, 20.0] {
        assert_eq!(reduce(&lattice, 900, kernel_m).kept.len(), 900);
        let half = reduce(&lattice, 100, kernel_m);
        let kept: Vec<Vec3> = half.kept.iter().map(|&index| lattice[index as usize]).collect();
        // 100 of 1000: two lattice steps between neighbors, at least a diagonal of one.
        assert!(nearest_other(&kept).into_iter().all(|distance| distance > 1.4), "kernel {kernel_m}");
    }
    let line: Vec<Vec3> = random_points(3000, 10.0).into_iter().map(|point| Vec3::X * point.x).collect();
    for kernel_m in [0.1, 1.0, 3.0, 50.0] {
        let kept: Vec<Vec3> = reduce(&line, 10, kernel_m).kept.iter().map(|&index| line[index as usize]).collect();
        // Ten on 10 m: up to 1.1 m apart.
        assert!(nearest_other(&kept).into_iter().all(|distance| distance > 0.5), "kernel {kernel_m}: {kept:?}");
    }
}

#[test]
fn of_far_too_many_candidates_an_even_share_is_thinned() {
    let line: Vec<Vec3> = (0..300_000).map(|index| Vec3::X * (index as f32 * 1e-4)).collect();
    let reduction = reduce(&line, 10, 3.0);
    assert_eq!((reduction.kept.len(), reduction.removed.len()), (10, 299_990));
    let mut all = [reduction.kept.clone(), reduction.removed].concat();
    all.sort_unstable();
    assert!(all.into_iter().eq(0..300_000));
    // Ten on 30 m. A gap of two kernels would have held a candidate of density 0, which is not removed.
    let gaps: Vec<f32> = reduction.kept.windows(2).map(|pair| (pair[1] - pair[0]) as f32 * 1e-4).collect();
    assert!(gaps.iter().all(|gap| (1.5..6.0).contains(gap)), "{gaps:?}");
}

#[test]
fn reduced_points_are_evenly_spread() {
    // 20 000 points of the unit square, 100 left: 0.1 m between points of a square grid, 0.107 m of a triangular one.
    // Random points would have some within 0.01 m and a hole of 0.2 m; so would a kernel left at 0.3 m or more.
    let square: Vec<Vec3> =
        random_points(20_000, 1.0).into_iter().map(|point| Vec3::new(point.x, 0.0, point.z)).collect();
    for kernel_m in [0.1, 0.02, 0.3, 5.0] {
        let reduction = reduce(&square, 100, kernel_m);
        let kept: Vec<Vec3> = reduction.kept.iter().map(|&index| square[index as usize]).collect();
        let nearest = nearest_other(&kept).into_iter().fold(f32::INFINITY, f32::min);
        assert!(nearest > 0.055, "kernel {kernel_m}: two points are {nearest} m apart");
        let hole = square
            .iter()
            .map(|point| kept.iter().map(|other| other.distance(*point)).fold(f32::INFINITY, f32::min))
            .fold(0.0, f32::max);
        assert!(hole < 0.17, "kernel {kernel_m}: a hole of {hole} m");
    }
}

#[test]
fn the_radius_gives_ten_probes_on_average_and_three_to_everyone() {
    let probes = random_points(200, 10.0);
    let mut receivers = random_points(5000, 10.0);
    // A far corner that would have none.
    receivers.extend((0..50).map(|index| Vec3::splat(30.0 + index as f32)));
    let (set, links, overlap) = support(&receivers, &probes, &|_, _| true, &BakeSettings::default(), None).unwrap();
    // The search ends within 0.01 unless a step of the count is in the way; steps here are 1 / 5050.
    assert!((overlap.mean - 10.0).abs() <= 0.011, "{overlap:?}");
    assert_eq!(overlap.least, 3);
    assert_eq!(links.probes.len(), links.start[receivers.len()] as usize);
    assert!(brute_force_support(&receivers, &probes, &links));
    assert!(links.radius_m.iter().all(|&radius| radius >= set.radius_m));
    for (receiver, position) in receivers.iter().enumerate() {
        let mut distances: Vec<f32> = probes.iter().map(|probe| probe.distance(*position)).collect();
        distances.sort_unstable_by(f32::total_cmp);
        assert_eq!(links.radius_m[receiver], set.radius_m.max(1.05 * distances[2]));
    }
    for asked in [1.0, 4.5, 60.0] {
        let settings = BakeSettings { overlap: asked, min_overlap: 0, ..Default::default() };
        let overlap = support(&receivers, &probes, &|_, _| true, &settings, None).unwrap().2;
        assert!((overlap.mean - asked).abs() <= 0.3, "asked for {asked}: {overlap:?}");
    }
}

#[test]
fn few_probes_support_everyone() {
    let receivers = random_points(500, 4.0);
    for count in [1, 2, 9, 10] {
        let probes = random_points(count, 4.0);
        let (set, links, overlap) = support(&receivers, &probes, &|_, _| true, &BakeSettings::default(), None).unwrap();
        assert_eq!((overlap.least, overlap.most), (count as u32, count as u32));
        assert!(links.radius_m.iter().all(|&radius| radius == set.radius_m && radius.is_finite()));
    }
    // A probe on the only receiver is still one of its probes.
    let (_, links, _) = support(&[Vec3::ONE], &[Vec3::ONE], &|_, _| true, &BakeSettings::default(), None).unwrap();
    assert_eq!(links.of(0), [0]);
    let error = support(&[], &[Vec3::ONE], &|_, _| true, &BakeSettings::default(), None).unwrap_err();
    assert_eq!(error, PlacementError::NoReceivers);
}

#[test]
fn a_minimum_above_the_overlap_wins() {
    let settings = BakeSettings { overlap: 2.0, min_overlap: 6, ..Default::default() };
    let (_, _, overlap) =
        support(&random_points(300, 1.0), &random_points(100, 1.0), &|_, _| true, &settings, None).unwrap();
    // 1.05 times the sixth distance holds 1.05^3 = 1.16 times 6 probes at even density, at most.
    assert!(overlap.least >= 6 && overlap.mean < 7.5, "{overlap:?}");
}

#[test]
fn placing_fills_both_rooms_and_keeps_its_promises() {
    let (probes, support, report) = run(&two_rooms_with_blocks(), 8000, &BakeSettings::default()).unwrap();
    let count = probes.positions.len();
    assert!(count >= report.target && count <= report.target + report.target / 10, "{report:?}");
    assert_eq!(count, report.target + report.repaired);
    assert!((report.overlap.0 - 10.0).abs() <= 0.3 && report.overlap.1 >= 3, "{report:?}");
    assert!(report.unseen_after <= report.unseen_before, "{report:?}");
    let left = probes.positions.iter().filter(|position| position.x < 4.0).count();
    // Surfaces: 94 and 113 square metres with the block and the sphere.
    assert!((0.35..0.55).contains(&(left as f32 / count as f32)), "{left} of {count} in the left room");
    assert!((0..support.radius_m.len()).all(|receiver| support.of(receiver).is_sorted()));
    // 207 square metres and 150 probes: 1.17 m between neighbors of a square grid.
    let thinned = &nearest_other(&probes.positions);
    let close = thinned.iter().filter(|&&distance| distance < 0.5).count();
    assert!(close <= 2 * report.repaired, "{close} probes within 0.5 m of another, {} repaired", report.repaired);
}

#[test]
fn candidates_stand_off_surfaces_as_far_as_the_space_allows() {
    let size = Vec3::new(6.0, 4.0, 5.0);
    let to_wall = |position: Vec3, size: Vec3| position.min(size - position).min_element();
    for (layer, size) in [(1u8, size), (4, size), (4, Vec3::new(6.0, 1.0, 5.0))] {
        let scene = scene(&[room(Vec3::ZERO, size)], false);
        let caster = RayCaster::new(&scene).unwrap();
        let settings = BakeSettings { voxel: Some(0.2), ..Default::default() };
        let grid = VoxelGrid::build(&scene, &caster, 1.0, f32::INFINITY, &settings).unwrap();
        let found = candidates(&grid, &caster, 50, layer, 0).unwrap();
        assert!(found.positions.len() > 200, "{}", found.positions.len());
        // Walls lie within solid voxels, so a layer's middle is off by up to half a voxel, and positions by as much.
        let wanted = (f32::from(layer) * 0.2).min(0.5 * size.y);
        for &position in &found.positions {
            let distance = to_wall(position, size);
            assert!((distance - wanted).abs() <= 0.2001, "layer {layer}, {size}: {distance} at {position}");
        }
    }
}

#[test]
fn an_explicit_count_is_kept_with_and_without_repair() {
    let scene = scene(&[corridor(6.0)], false);
    for probes in [1, 2, 7, 40] {
        for repair in [0.0, 0.3] {
            let (set, support, report) = run(&scene, 300, &BakeSettings { repair, ..exactly(probes) }).unwrap();
            assert_eq!(set.positions.len(), probes as usize, "repair {repair}: {report:?}");
            assert!(report.overlap.1 >= probes.min(3), "{report:?}");
            assert_eq!(support.radius_m.iter().filter(|radius| !radius.is_finite()).count(), 0);
        }
    }
}

#[test]
fn repair_lowers_the_unseen_share_of_a_corridor() {
    let scene = labyrinth();
    // Beside the walls, where a corner hides more from a probe than it does from the middle of the corridor.
    let settings = BakeSettings { standoff: 0.0, overlap: 3.0, min_overlap: 1, repair: 0.3, ..exactly(20) };
    let (_, _, report) = run(&scene, 3000, &settings).unwrap();
    assert!(report.unseen_before > 0.02, "nothing to repair: {report:?}");
    assert!(report.repaired > 0 && report.unseen_after < 0.7 * report.unseen_before, "{report:?}");
    let (_, _, without) = run(&scene, 3000, &BakeSettings { repair: 0.0, ..settings }).unwrap();
    assert_eq!((without.repaired, without.unseen_after), (0, without.unseen_before));
    assert_eq!(without.unseen_before, report.unseen_before);
}

#[test]
fn coverage_of_one_probe_is_what_it_sees() {
    // A convex room: every point sees every other, so nothing is unseen; with the probe behind a wall all is.
    let scene = scene(&[room(Vec3::ZERO, Vec3::splat(2.0))], false);
    let caster = RayCaster::new(&scene).unwrap();
    let (receivers, normals) = surface_points(&scene, 500);
    let coverage = Coverage::sample(&caster, &receivers, &normals, 0);
    assert_eq!(coverage.samples.len(), 32 * receivers.len());
    let share = |probe: Vec3| {
        let (set, links, _) = support(&receivers, &[probe], &|_, _| true, &BakeSettings::default(), None).unwrap();
        coverage.unseen_share(&set, &links)
    };
    assert_eq!(share(Vec3::new(0.3, 1.7, 1.1)), 0.0);
    assert_eq!(share(Vec3::splat(2.5)), 1.0);
}

#[test]
fn placement_repeats_on_any_number_of_threads() {
    let scene = two_rooms_with_blocks();
    let settings = BakeSettings { overlap: 6.0, ..Default::default() };
    let placed = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&scene, 4000, &settings).unwrap())
    };
    assert_eq!(placed(1), placed(4));
}

#[test]
fn scale_and_place_do_not_matter() {
    let place_at = |scale: f32, offset: Vec3| {
        let at = |x: f32, y: f32, z: f32| offset + Vec3::new(x, y, z) * scale;
        let parts = [room(at(0.0, 0.0, 0.0), at(4.0, 3.0, 5.0)), block(at(1.0, 0.5, 1.0), at(2.4, 1.8, 2.4))];
        let (probes, _, report) = run(&scene(&parts, false), 2000, &BakeSettings::default()).unwrap();
        let inside = |position: &Vec3| {
            let local = (*position - offset) / scale;
            local.cmpgt(Vec3::ZERO).all() && local.cmplt(Vec3::new(4.0, 3.0, 5.0)).all()
        };
        assert!(probes.positions.iter().all(inside), "scale {scale}, offset {offset}: outside");
        assert!((report.overlap.0 - 10.0).abs() <= 0.3 && report.overlap.1 >= 3, "scale {scale}: {report:?}");
        assert!(probes.positions.len() >= 120, "scale {scale}, offset {offset}: {report:?}");
    };
    place_at(1.0, Vec3::ZERO);
    place_at(2.5e4, Vec3::ZERO);
    place_at(2e-4, Vec3::ZERO);
    place_at(1.0, Vec3::new(-1e4, 2e4, 3e3));
    place_at(1.0, Vec3::splat(1e5));
}

#[test]
fn what_cannot_be_placed_is_named() {
    let closed = scene(&[room(Vec3::ZERO, Vec3::splat(2.0))], false);
    let settings = |change: fn(&mut BakeSettings)| {
        let mut settings = BakeSettings::default();
        change(&mut settings);
        settings
    };
    for bad in [
        settings(|settings| settings.overlap = 0.0),
        settings(|settings| settings.overlap = f32::NAN),
        settings(|settings| settings.repair = -0.1),
        settings(|settings| settings.probes = Some(0)),
        settings(|settings| settings.probes = Some(u32::MAX)),
    ] {
        let error = run(&closed, 100, &bad).unwrap_err();
        assert!(matches!(error, PlacementError::InvalidOption { .. }), "{error}");
    }
    let bounds = closed.bounds().unwrap();
    let error = target_count(bounds, 1e-4, &BakeSettings::default()).unwrap_err();
    assert!(matches!(error, PlacementError::TooManyProbes { .. }), "{error}");
    assert_eq!(target_count(bounds, 0.5, &BakeSettings::default()), Ok(125));
    assert_eq!(target_count((Vec3::ZERO, Vec3::new(3.0, 0.0, 2.0)), 1.0, &BakeSettings::default()), Ok(12));

    // A block alone, with its inside asked for: there are voxels, but all rays meet backs.
    let solid = scene(&[block(Vec3::ZERO, Vec3::splat(2.0))], false);
    let inside = BakeSettings { interior: vec![[1.0; 3]], ..Default::default() };
    let error = run(&solid, 100, &inside).unwrap_err();
    assert!(matches!(error, PlacementError::NoCandidate { .. }), "{error}");
    // Voxels as large as the room leave no empty one inside.
    let coarse = BakeSettings { voxel: Some(1.9), ..Default::default() };
    let error = run(&closed, 100, &coarse).unwrap_err();
    assert!(matches!(error, PlacementError::NoOpenSpace { .. }), "{error}");
    let caster = RayCaster::new(&closed).unwrap();
    let grid = VoxelGrid::build(&closed, &caster, 0.5, f32::INFINITY, &BakeSettings::default()).unwrap();
    let error =
        place(&caster, &grid, 0.5, &LocalScale::uniform(), &[], &[], &BakeSettings::default(), None).unwrap_err();
    assert_eq!(error, PlacementError::NoReceivers);
}
