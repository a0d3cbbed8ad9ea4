//! Closed forms of transport rows.

use super::*;
use crate::lightmap::ReceiverSet;
use crate::lightmap::{Atlas, texels};
use glam::{Vec2, Vec3};
use localprt_formats::directions::{counter_uniform, spherical_fibonacci};
use localprt_scenes::{Material, Mesh, Scene, SurfacePoint};
use std::f32::consts::PI;

/// A box with its faces turned inwards; `skip` leaves out the face `[axis, sign]`.
pub(super) fn room(half: Vec3, skip: Option<(usize, f32)>) -> Scene {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            if skip == Some((axis, sign)) {
                continue;
            }
            let first = mesh.positions.len() as u32;
            for (y, x) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0f32)] {
                let mut point = [0.0; 3];
                point[axis] = sign;
                point[(axis + 1) % 3] = x;
                point[(axis + 2) % 3] = y;
                mesh.positions.push(Vec3::from(point) * half);
                let mut normal = [0.0; 3];
                normal[axis] = -sign;
                mesh.normals.push(Vec3::from(normal));
            }
            let [a, b, c, d] = [first, first + 1, first + 2, first + 3];
            mesh.triangles.extend(if sign < 0.0 { [[a, b, d], [a, d, c]] } else { [[a, d, b], [a, c, d]] });
        }
    }
    Scene { meshes: vec![mesh], materials: vec![Material::default()], ..Scene::default() }
}

fn point((position, normal): (Vec3, Vec3)) -> SurfacePoint {
    SurfacePoint { position, normal, geometric_normal: normal }
}

/// Rows of receivers given as `(position, normal)` with every probe supporting each; without normals, of points in the open.
pub(super) struct Setup {
    receivers: ReceiverSet,
    probes: ProbeSet,
    support: Support,
}

impl Setup {
    pub(super) fn new(receivers: &[(Vec3, Vec3)], probes: &[Vec3], radius_m: f32) -> Self {
        let n = receivers.len();
        Self {
            receivers: ReceiverSet::of_points(&receivers.iter().map(|&at| point(at)).collect::<Vec<_>>()),
            probes: ProbeSet { positions: probes.to_vec(), radius_m },
            support: Support {
                start: (0..=n as u32).map(|i| i * probes.len() as u32).collect(),
                probes: (0..n).flat_map(|_| 0..probes.len() as u32).collect(),
                radius_m: vec![radius_m; n],
            },
        }
    }

    pub(super) fn rows(&self, scene: &Scene, gather: &GatherSet, probe_degree: u32, sky_degree: u32) -> TransportRows {
        self.with(scene, gather, [probe_degree, sky_degree], false, |transport, members| {
            transport.rows(&transport.leaf(members).expect("in memory"), members)
        })
    }

    /// Rows with near light of so many bytes a receiver, read from a map of `size` texels over a scene with TEXCOORD_1.
    fn rows_with_near_light(
        &self,
        scene: &Scene,
        gather: &GatherSet,
        fitted: bool,
        size: u32,
        bytes: f32,
    ) -> TransportRows {
        self.with(scene, gather, [3, 0], fitted, |transport, members| {
            let atlas = Atlas::of(scene);
            let map = texels::cover(scene, &atlas, size);
            let near = NearField::new(transport.caster, atlas, &map, transport.probes, transport.support);
            let near = near.within(bytes, transport);
            let transport = TransportScene { near: Some(&near), ..*transport };
            transport.rows(&transport.leaf(members).expect("in memory"), members)
        })
    }

    /// What `look` finds in the transport stage, with fitted rows or the paper's, and all receivers. `degrees` are those of
    /// the probes and of the sky.
    pub(super) fn with<T>(
        &self,
        scene: &Scene,
        gather: &GatherSet,
        degrees: [u32; 2],
        fitted: bool,
        look: impl FnOnce(&TransportScene<'_>, &[u32]) -> T,
    ) -> T {
        let caster = RayCaster::new(scene).expect("tree");
        let members: Vec<u32> = (0..self.receivers.len() as u32).collect();
        let [probe_basis, sky_basis] = degrees.map(sh::Basis::new);
        let atlas = Atlas::default();
        let directions = crate::probe_views::ProbeDirections::new(RELIGHT_RAYS, &probe_basis);
        let fit = fitted.then(|| {
            FitScene::new(&caster, &atlas, &self.receivers, &self.probes, &directions, None).expect("in memory")
        });
        let transport = TransportScene {
            caster: &caster,
            receivers: match self.receivers.normal.iter().all(|normal| *normal == Vec3::ZERO) {
                true => Receivers::Open(&self.receivers.position),
                false => Receivers::Surface(&self.receivers),
            },
            probes: &self.probes,
            support: &self.support,
            gather,
            probe_basis: &probe_basis,
            sky_basis: &sky_basis,
            fit: fit.as_ref(),
            near: None,
            cells: None,
        };
        look(&transport, &members)
    }
}

/// Relight rays of the fit.
const RELIGHT_RAYS: u32 = 2000;

pub(super) fn some_probes(n: u64, half: Vec3) -> Vec<Vec3> {
    (0..n)
        .map(|i| (Vec3::from([0, 1, 2].map(|axis| counter_uniform(3, i, axis) as f32)) * 2.0 - 1.0) * half * 0.9)
        .collect()
}

/// Receivers on the floor, on a wall and askew in the room.
pub(super) fn some_receivers(half: Vec3) -> [(Vec3, Vec3); 3] {
    [
        (Vec3::new(0.3, -1.0, 0.2) * half, Vec3::Y),
        (Vec3::new(-1.0, 0.1, -0.4) * half, Vec3::X),
        (Vec3::new(0.1, 0.2, 0.3) * half, Vec3::new(1.0, -2.0, 0.5).normalize()),
    ]
}

#[test]
fn constant_radiance_gives_pi_times_the_seen_share_at_every_degree() {
    let half = Vec3::new(2.0, 1.5, 3.0);
    let scene = room(half, None);
    let setup = Setup::new(&some_receivers(half), &some_probes(7, half), 8.0);
    for degree in 0..=sh::MAX_DEGREE {
        let rows = setup.rows(&scene, &GatherSet::new(256, 0, 0), degree, 2);
        for (row, unseen) in rows.rows.chunks_exact(rows.n_columns).zip(&rows.unseen) {
            // Radiance 1 has the coefficient sqrt(4 pi) in the constant function and none elsewhere.
            let irradiance: f32 =
                row.chunks_exact(function_count(degree)).take(7).map(|probe| probe[0] * (4.0 * PI).sqrt()).sum();
            // 256 rays of f32 weights.
            assert!((irradiance - PI * (1.0 - unseen)).abs() < 1e-4, "degree {degree}: {irradiance}");
            assert!(*unseen < 0.01, "an empty convex room hides nothing but the horizon: {unseen}");
        }
    }
}

fn function_count(degree: u32) -> usize {
    sh::function_count(degree)
}

#[test]
fn rows_and_links_share_constant_radiance_between_them() {
    let half = Vec3::new(2.0, 1.5, 3.0);
    let mut scene = room(half, None);
    // A cell of a grid of 3 x 2 for each wall.
    let cell = |vertex: usize| {
        let (wall, corner) = (vertex / 4, vertex % 4);
        let within = Vec2::new((corner % 2) as f32, (corner / 2) as f32) * 0.8 + 0.1;
        (Vec2::new((wall % 3) as f32, (wall / 3) as f32) + within) * Vec2::new(1.0 / 3.0, 0.5)
    };
    scene.meshes[0].uv_sets = vec![Vec::new(), (0..24).map(cell).collect()];
    // One in a corner, where all is near; others where light fades from links to probes.
    let mut receivers = some_receivers(half).to_vec();
    receivers.push((Vec3::new(-0.97, -1.0, -0.97) * half, Vec3::Y));
    let setup = Setup::new(&receivers, &some_probes(12, half), 8.0);
    for (degree, fitted) in [(0, false), (0, true), (1, true)] {
        let gather = GatherSet::new(512, degree, 0);
        let with = |bytes| setup.rows_with_near_light(&scene, &gather, fitted, 128, bytes);
        let count = |rows: &TransportRows| rows.links.iter().map(|links| links.nodes.len()).sum::<usize>();
        let all = [0.0, 40.0, 1000.0].map(with);
        let counts = all.each_ref().map(count);
        assert!(counts[0] == 0 && counts[1] > 0 && counts[2] > counts[1], "{counts:?}");
        let alone = setup.with(&scene, &gather, [3, 0], fitted, |transport, members| {
            transport.rows(&transport.leaf(members).expect("in memory"), members)
        });
        for rows in &all {
            for (member, links) in rows.links.iter().enumerate() {
                // Radiance 1: sqrt(4 pi) in the first function of each probe, 1 in each node.
                let output = |rows: &TransportRows, k: usize| {
                    let row = &rows.rows[(member * rows.n_k + k) * rows.n_columns..][..rows.n_columns];
                    row.chunks_exact(16).take(12).map(|probe| probe[0]).sum::<f32>() * (4.0 * PI).sqrt()
                };
                for k in 0..rows.n_k {
                    let linked: f32 = links.weights.iter().skip(k).step_by(rows.n_k).sum();
                    let (found, expected) = (output(rows, k) + linked, output(&alone, k));
                    // The paper's rows give the same; fitted ones keep constant light to a percent of the usual.
                    let allowed = if fitted { 0.01 * PI } else { 1e-4 };
                    assert!((found - expected).abs() < allowed, "degree {degree} output {k}: {found} {expected}");
                }
                assert!(rows.unseen[member] <= alone.unseen[member] + 1e-6);
            }
        }
        // In the corner most comes from the map.
        let corner: f32 = all[2].links[3].weights.iter().step_by(all[2].n_k).sum();
        let total = if degree == 0 { PI } else { PI.sqrt() };
        assert!(corner > 0.5 * total, "{corner} of {total}");
    }
}

#[test]
fn a_probe_at_the_receiver_gets_the_cosine_lobe() {
    // Seen from the same place, psi is omega, so alpha_j is the projection of the clamped cosine about the normal:
    // A_l Y_lm(n) with A = pi, 2 pi/3, pi/4, 0, -pi/24, 0 (Ramamoorthi and Hanrahan 2001). Signs and axes show here.
    let lobe = [PI, 2.0 * PI / 3.0, PI / 4.0, 0.0, -PI / 24.0, 0.0];
    let half = Vec3::splat(50.0);
    let scene = room(half, None);
    for i in 0..12 {
        let normal = Vec3::from(spherical_fibonacci(i, 12));
        let setup = Setup::new(&[(Vec3::ZERO, normal)], &[normal * 1e-3], 1.0);
        let rows = setup.rows(&scene, &GatherSet::new(4096, 0, 0), 5, 0);
        let mut values = [0.0; 36];
        sh::Basis::new(5).evaluate(normal.to_array(), &mut values);
        for l in 0..=5u32 {
            for m in -(l as i32)..=l as i32 {
                let j = sh::index(l, m);
                let expected = lobe[l as usize] * values[j];
                // 4096 Fibonacci points integrate a degree-5 polynomial over the disc to about 1e-3.
                assert!((rows.rows[j] - expected).abs() < 3e-3, "l {l} m {m}: {} {expected}", rows.rows[j]);
            }
        }
    }
}

#[test]
fn degree_1_rows_give_pi_at_the_normal_and_the_right_direction() {
    let half = Vec3::new(2.0, 1.5, 3.0);
    let scene = room(half, None);
    let receivers = some_receivers(half);
    let setup = Setup::new(&receivers, &some_probes(7, half), 8.0);
    let rows = setup.rows(&scene, &GatherSet::new(1024, 1, 0), 4, 2);
    assert_eq!(rows.n_k, 4);
    for (receiver, (rows_of, unseen)) in
        receivers.iter().zip(rows.rows.chunks_exact(4 * rows.n_columns).zip(&rows.unseen))
    {
        let coefficients: Vec<f32> = rows_of
            .chunks_exact(rows.n_columns)
            .map(|row| row.chunks_exact(25).take(7).map(|probe| probe[0] * (4.0 * PI).sqrt()).sum())
            .collect();
        let weights = sh::irradiance_weights_degree_1(receiver.1.to_array());
        let irradiance: f32 = coefficients.iter().zip(&weights).map(|(a, b)| a * b).sum();
        // The hemisphere above the normal gives exactly pi; 1024 Fibonacci points leave about 1e-3 of it.
        assert!((irradiance - PI * (1.0 - unseen)).abs() < 5e-3, "{irradiance} unseen {unseen}");
        // The linear terms point along the normal: b_1 = (y, z, x) sqrt(3/4pi) pi.
        let linear = Vec3::new(coefficients[3], coefficients[1], coefficients[2]) / ((3.0 / (4.0 * PI)).sqrt() * PI);
        assert!(linear.distance(receiver.1) < 1e-2, "{linear} {}", receiver.1);
    }
}

#[test]
fn an_open_roof_lets_in_the_sky_and_nothing_is_counted_twice() {
    // Without its ceiling the room's floor sees sky and walls; under a sky of 1 and walls of 1 they add up to pi.
    let half = Vec3::new(2.0, 1.5, 3.0);
    let scene = room(half, Some((1, 1.0)));
    let setup = Setup::new(&some_receivers(half)[..1], &some_probes(7, half), 8.0);
    let rows = setup.rows(&scene, &GatherSet::new(512, 0, 0), 3, 3);
    let constant = (4.0 * PI).sqrt();
    let walls: f32 = rows.rows.chunks_exact(16).take(7).map(|probe| probe[0] * constant).sum();
    let sky = rows.rows[7 * 16] * constant;
    assert!(sky > 0.5 && walls > 0.5, "{sky} {walls}");
    assert!((sky + walls - PI * (1.0 - rows.unseen[0])).abs() < 1e-4, "{sky} + {walls}");
}

#[test]
fn fitted_rows_know_a_small_opening_better_than_their_few_rays() {
    // Receivers on the floor of a shaft without a roof, 1 x 0.6 m wide and 3 m high.
    let half = Vec3::new(0.5, 1.5, 0.3);
    let scene = room(half, Some((1, 1.0)));
    let place = |i: u32, axis: u64| counter_uniform(8, u64::from(i), axis) as f32 * 1.8 - 0.9;
    let floor: Vec<(Vec3, Vec3)> =
        (0..40).map(|i| (Vec3::new(place(i, 0), -1.0, place(i, 1)) * half, Vec3::Y)).collect();
    // Of a point to a rectangle above, in quarters: X / sqrt(1 + X^2) atan(Y / sqrt(1 + X^2)), and the same of Y and X, over 2 pi.
    let quarter = |x: f32, y: f32| {
        let part = |x: f32, y: f32| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
        part(x, y) + part(y, x)
    };
    let expected = |position: Vec3| {
        let [x, z] =
            [0, 2].map(|axis| [half[axis] - position[axis], half[axis] + position[axis]].map(|side| side / 3.0));
        0.5 * x.into_iter().flat_map(|x| z.map(|z| quarter(x, z))).sum::<f32>()
    };
    let setup = Setup::new(&floor, &some_probes(7, half), 8.0);
    let errors = [false, true].map(|fitted| {
        let gather = GatherSet::new(256, 0, 0);
        let rows = setup.with(&scene, &gather, [3, 0], fitted, |transport, members| {
            transport.rows(&transport.leaf(members).expect("in memory"), members)
        });
        let error =
            |(row, &(position, _)): (&[f32], &(Vec3, Vec3))| row[7 * 16] * (4.0 * PI).sqrt() / expected(position) - 1.0;
        let errors: Vec<f32> = rows.rows.chunks_exact(rows.n_columns).zip(&floor).map(error).collect();
        (errors.iter().map(|error| error * error).sum::<f32>() / errors.len() as f32).sqrt()
    });
    // The borders of an opening have to be looked at, but not what lies between them.
    let gather = GatherSet::new(256, 0, 0);
    let rays = setup.with(&scene, &gather, [3, 0], true, |transport, members| {
        transport.rows(&transport.leaf(members).expect("in memory"), members).rays.gather
    });
    let all = 40 * (256 + u64::from(gather::SKY_TIMES) * 256);
    assert!(rays < all * 7 / 10, "{rays} of {all}");
    // Of four times as many rays a lattice is off by 4^-3/4 = 0.35 of what it is, for smooth borders; this one has corners.
    let [few, more] = errors;
    assert!(more < 0.6 * few && more < 0.1, "{few} {more}");
}

#[test]
fn gather_rays_are_as_many_as_a_receiver_needs() {
    // Walls of one color, and the same with posts before them that cut the view into pieces.
    let half = Vec3::new(2.0, 1.5, 3.0);
    let plain = room(half, None);
    let mut posts = room(half, None);
    for i in 0..40 {
        let at = |axis: u64| counter_uniform(11, i, axis) as f32 * 1.8 - 0.9;
        let mut post = room(Vec3::new(0.03, 1.5, 0.03), None).meshes.remove(0);
        for (position, normal) in post.positions.iter_mut().zip(&mut post.normals) {
            *position += Vec3::new(at(0), 0.0, at(1)) * half;
            *normal = -*normal;
        }
        post.triangles.iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
        posts.meshes.push(post);
    }
    let floor: Vec<(Vec3, Vec3)> = (0..12)
        .map(|i| {
            let at = |axis: u64| counter_uniform(12, i, axis) as f32 * 1.6 - 0.8;
            (Vec3::new(at(0), -1.0, at(1)) * half, Vec3::Y)
        })
        .collect();
    let setup = Setup::new(&floor, &some_probes(7, half), 8.0);
    let gather = GatherSet::new(2048, 0, 0);
    for scene in [plain, posts] {
        setup.with(&scene, &gather, [3, 0], true, |transport, members| {
            let leaf = transport.leaf(members).expect("in memory");
            let counted = transport.rows(&leaf, members);
            // Nothing tells the paper's rows when there are enough.
            let paper = TransportScene { fit: None, ..*transport };
            let of_paper = paper.leaf(members).expect("in memory");
            assert_eq!(paper.rows_alone(&leaf, members).rows, paper.rows_alone(&of_paper, members).rows);
            let leaf = TransportLeaf { tolerance: Vec::new(), ..leaf };
            let all = transport.rows(&leaf, members);
            let exact = transport.rows(&TransportLeaf { tolerance: vec![0.0], ..leaf }, members);
            assert_eq!(exact.rows, all.rows, "a tolerance of 0 takes all rays");
            // In radiance 1: sqrt(4 pi) in the first function of each probe.
            let irradiance = |row: &[f32]| row.chunks_exact(16).take(7).map(|probe| probe[0]).sum::<f32>();
            let light = |rows: &TransportRows| {
                let of_rows = rows.rows.chunks_exact(rows.n_columns);
                of_rows.map(|row| irradiance(row) * (4.0 * PI).sqrt()).collect::<Vec<_>>()
            };
            // Either keeps constant light to a percent of the usual.
            for (found, expected) in light(&counted).into_iter().zip(light(&all)) {
                assert!((found - expected).abs() < 0.02 * PI, "{found} {expected}");
            }
            // Those of the pilots are in both.
            assert!(counted.rays.gather * 4 < all.rays.gather * 3, "{:?} of {:?}", counted.rays, all.rays);
        });
    }
}

#[test]
fn receivers_on_two_sides_of_a_floor_do_not_take_each_others_sky() {
    // A closed room, receivers on its floor, and as many below it that see nothing but sky.
    let half = Vec3::new(2.0, 1.5, 3.0);
    let scene = room(half, None);
    let at = |i: u64, axis: u64| counter_uniform(14, i, axis) as f32 * 1.6 - 0.8;
    let place = |i: u64, y: f32| Vec3::new(at(i, 0) * half.x, y, at(i, 1) * half.z);
    let both: Vec<(Vec3, Vec3)> =
        (0..40).flat_map(|i| [(place(i, -half.y), Vec3::Y), (place(i, -half.y - 0.05), Vec3::NEG_Y)]).collect();
    let setup = Setup::new(&both, &some_probes(7, half), 8.0);
    let rows = setup.with(&scene, &GatherSet::new(1024, 0, 0), [3, 2], true, |transport, members| {
        transport.rows(&transport.leaf(members).expect("in memory"), members)
    });
    for (index, row) in rows.rows.chunks_exact(rows.n_columns).enumerate() {
        let sky = row[7 * 16] * (4.0 * PI).sqrt();
        // 4096 equal f32 weights.
        let expected = if index % 2 == 0 { 0.0 } else { PI };
        assert!((sky - expected).abs() < 1e-3, "receiver {index}: {sky}, not {expected}");
    }
}

#[test]
fn an_open_plane_receives_pi_from_a_constant_sky() {
    let floor = Mesh {
        positions: vec![Vec3::new(-5.0, 0.0, -5.0), Vec3::new(0.0, 0.0, 9.0), Vec3::new(5.0, 0.0, -5.0)],
        normals: vec![Vec3::Y; 3],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let scene = Scene { meshes: vec![floor], materials: vec![Material::default()], ..Scene::default() };
    let setup = Setup::new(&[(Vec3::ZERO, Vec3::Y)], &[Vec3::Y], 3.0);
    let rows = setup.rows(&scene, &GatherSet::new(1024, 0, 0), 2, 4);
    let sky = rows.rows[9] * (4.0 * PI).sqrt();
    // 1024 equal f32 weights.
    assert!((sky - PI).abs() < 1e-4, "{sky}");
    assert!(rows.rows[..9].iter().all(|&value| value == 0.0));
    assert_eq!(rows.unseen[0], 0.0);
}

#[test]
fn a_probe_behind_a_wall_gives_exactly_nothing() {
    // A second room beside the first: its probe sees no surface that the receiver sees.
    let half = Vec3::new(2.0, 1.5, 3.0);
    let mut scene = room(half, None);
    let mut other = room(half, None).meshes.remove(0);
    for position in &mut other.positions {
        position.x += 4.001;
    }
    scene.meshes.push(other);
    let inside = some_probes(3, half);
    let mut probes = inside.clone();
    probes.push(Vec3::new(2.2, 0.0, 0.0));
    let setup = Setup::new(&[(Vec3::new(1.9, -1.5, 0.0), Vec3::Y)], &probes, 8.0);
    let rows = setup.rows(&scene, &GatherSet::new(512, 0, 0), 3, 0);
    assert!(rows.rows[..3 * 16].iter().any(|&value| value != 0.0));
    assert!(rows.rows[3 * 16..4 * 16].iter().all(|&value| value == 0.0));
}

#[test]
fn what_no_probe_sees_is_counted() {
    // One probe under a table top sees nothing of the ceiling's middle; the receiver on top of the table does.
    let half = Vec3::splat(2.0);
    let mut scene = room(half, None);
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0f32)];
    let table = Mesh {
        positions: corners.map(|(x, z)| Vec3::new(x, 0.0, z)).to_vec(),
        normals: vec![Vec3::Y; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    scene.meshes.push(table);
    let setup = Setup::new(&[(Vec3::new(0.0, 0.0, 0.0), Vec3::Y)], &[Vec3::new(0.0, -0.2, 0.0)], 3.0);
    let rows = setup.rows(&scene, &GatherSet::new(1024, 0, 0), 2, 0);
    let seen = rows.rows[0] * (4.0 * PI).sqrt() / PI;
    // The ceiling's middle alone, |x|, |z| < 1 at distance 2, holds a form factor of 0.24.
    assert!(rows.unseen[0] > 0.24, "{}", rows.unseen[0]);
    assert!((seen + rows.unseen[0] - 1.0).abs() < 1e-4, "{seen} {}", rows.unseen[0]);
}

#[test]
fn a_point_in_the_open_gets_the_sky_as_it_is() {
    // One small triangle far below. Orthonormal functions: the row of output k is 1 at the sky's function k and 0 elsewhere.
    let scene = room(Vec3::splat(1e-3), None);
    let receivers = [(Vec3::new(0.0, 5.0, 0.0), Vec3::ZERO), (Vec3::new(4.0, 1.0, -3.0), Vec3::ZERO)];
    let setup = Setup::new(&receivers, &[Vec3::new(0.0, 6.0, 0.0)], 8.0);
    for degree in [1, 2] {
        let rows = setup.rows(&scene, &GatherSet::sphere(1024, degree, 0), 2, 3);
        assert_eq!((rows.n_k, rows.unseen.clone()), (sh::function_count(degree), vec![0.0; 2]));
        for (index, row) in rows.rows.chunks_exact(rows.n_columns).enumerate() {
            let k = index % rows.n_k;
            for (s, value) in row[9..].iter().enumerate() {
                let expected = if s == k { 1.0 } else { 0.0 };
                // The constant is exact. Products of functions are smooth: about n^(-3/2) of the lattice, times their size.
                let tolerance = if (k, s) == (0, 0) { 1e-5 } else { 5e-3 };
                assert!((value - expected).abs() < tolerance, "degree {degree}: {k} {s}: {value}");
            }
            assert!(row[..9].iter().all(|value| *value == 0.0), "nothing but sky");
        }
    }
}

#[test]
fn a_probe_at_a_point_in_a_room_hands_on_its_radiance() {
    // psi is omega where the probe is the receiver: the row of output k is 1 at the probe's function k and 0 elsewhere.
    let half = Vec3::new(2.0, 1.5, 3.0);
    let at = Vec3::new(0.3, -0.2, 0.4);
    let setup = Setup::new(&[(at, Vec3::ZERO)], &[at], 8.0);
    let rows = setup.rows(&room(half, None), &GatherSet::sphere(4096, 2, 0), 3, 0);
    assert!(rows.unseen[0] < 1e-3, "{}", rows.unseen[0]);
    for (k, row) in rows.rows.chunks_exact(rows.n_columns).enumerate() {
        for (j, value) in row[..16].iter().enumerate() {
            let expected = if j == k { 1.0 } else { 0.0 };
            assert!((value - expected).abs() < 5e-3, "{k} {j}: {value}");
        }
    }
}
