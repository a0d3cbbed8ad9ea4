use super::*;
use crate::passes::shadow_map::{AlphaImage, AlphaMask, CasterMasks};
use localprt_formats::directions::counter_uniform;
use localprt_scenes::{Light, LightKind, Wrap};

const SIZE: u32 = 64;

fn view(kind: LightKind, casters: &ShadowCasters) -> ShadowView {
    let light = Light {
        name: String::new(),
        kind,
        position: Vec3::new(0.3, -0.2, 0.1),
        direction: Vec3::new(0.2, -0.1, -1.0).normalize(),
        color: Vec3::ONE,
        intensity: 1.0,
        range: None,
    };
    super::super::shadow_views(&light, &casters.bounds(), SIZE)[0]
}

fn spot() -> LightKind {
    LightKind::Spot { inner_cone: 0.0, outer_cone: 0.7 }
}

fn random_casters(seed: u64, n_triangles: u32) -> ShadowCasters {
    let position = |vertex: u32| {
        Vec3::from([0, 1, 2].map(|axis| 4.0 * counter_uniform(seed, u64::from(vertex), axis) as f32 - 2.0))
    };
    ShadowCasters {
        positions: (0..3 * n_triangles).map(position).collect(),
        triangles: (0..n_triangles).map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner)).collect(),
        masks: None,
    }
}

/// Half a dozen cells of a wavy sheet: every edge inside is shared by two triangles.
fn sheet() -> ShadowCasters {
    let n = 6;
    let position = |index: u32| {
        let (x, y) = ((index % (n + 1)) as f32 / 3.0 - 1.0, (index / (n + 1)) as f32 / 3.0 - 1.0);
        Vec3::new(2.0 * x + 0.1 * (5.0 * y).sin(), 2.0 * y, -2.0 + 0.3 * (3.0 * x).sin())
    };
    let cell = |index: u32| {
        let a = index / n * (n + 1) + index % n;
        [[a, a + 1, a + n + 2], [a + n + 2, a, a + n + 1]]
    };
    ShadowCasters {
        positions: (0..(n + 1) * (n + 1)).map(position).collect(),
        triangles: (0..n * n).flat_map(cell).collect(),
        masks: None,
    }
}

/// Ray through a point of the map given in texels: start and way with unit depth, in world space.
fn ray(view: &ShadowView, kind: LightKind, x: f64, y: f64) -> (DVec3, DVec3) {
    let size = f64::from(SIZE);
    let ndc = DVec2::new(2.0 * x / size - 1.0, 1.0 - 2.0 * y / size) / view.scale.as_dvec2();
    let across = view.right.as_dvec3() * ndc.x + view.up.as_dvec3() * ndc.y;
    match kind {
        LightKind::Directional => (view.origin.as_dvec3() + across, view.forward.as_dvec3()),
        _ => (view.origin.as_dvec3(), view.forward.as_dvec3() + across),
    }
}

/// Depth of the nearest triangle at a point of the map by brute force.
fn traced_depth(view: &ShadowView, kind: LightKind, casters: &ShadowCasters, x: f64, y: f64) -> f64 {
    let (start, way) = ray(view, kind, x, y);
    let depths = casters.triangles.iter().filter_map(|triangle| {
        let [a, b, c] = triangle.map(|vertex| casters.positions[vertex as usize].as_dvec3());
        let (ab, ac, to_start) = (b - a, c - a, start - a);
        let determinant = way.cross(ac).dot(ab);
        let u = way.cross(ac).dot(to_start) / determinant;
        let v = to_start.cross(ab).dot(way) / determinant;
        let z = to_start.cross(ab).dot(ac) / determinant;
        let clip_z = f64::from(view.depth.x) + f64::from(view.depth.y) * z;
        let clip_w = f64::from(view.w.x) + f64::from(view.w.y) * z;
        let is_hit = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && clip_z <= clip_w && clip_w > 0.0;
        is_hit.then_some(clip_z / clip_w)
    });
    depths.fold(0.0, f64::max)
}

#[test]
fn maps_hold_what_rays_meet() {
    for kind in [LightKind::Directional, spot()] {
        // Triangles all around the light: many cross the near plane or the sides.
        let casters = random_casters(3, 12);
        let view = view(kind, &casters);
        let map = shadow_map(&view, &casters, SIZE);
        let mut n_covered = 0;
        for (index, &depth) in map.depth.iter().enumerate() {
            let (x, y) = ((index as u32 % SIZE) as f64 + 0.5, (index as u32 / SIZE) as f64 + 0.5);
            // Corners move by half of 1 / 256 texel in x and y, so every point of a triangle by no more. f32 rounding of
            // clip coordinates is a few 2^-24 * 64 texels, far less.
            let reach = 0.5 / 256.0 + 1e-4;
            let around = [(0.0, 0.0), (reach, reach), (reach, -reach), (-reach, reach), (-reach, -reach)];
            let depths = around.map(|(dx, dy)| traced_depth(&view, kind, &casters, x + dx, y + dy));
            let (low, high) = (depths.iter().copied().fold(1.0, f64::min), depths.iter().copied().fold(0.0, f64::max));
            assert!(f64::from(depth) >= low * (1.0 - 1e-6) - 1e-7, "{kind:?} {index}: {depth} below {low}");
            assert!(f64::from(depth) <= high * (1.0 + 1e-6) + 1e-7, "{kind:?} {index}: {depth} above {high}");
            n_covered += usize::from(depth > 0.0);
        }
        assert!((800..4090).contains(&n_covered), "{kind:?}: {n_covered}");
    }
}

#[test]
fn triangles_that_share_an_edge_cover_each_texel_once() {
    for kind in [LightKind::Directional, spot()] {
        let casters = sheet();
        let view = view(kind, &casters);
        let whole = shadow_map(&view, &casters, SIZE);
        let mut n_drawn = vec![0; whole.depth.len()];
        for triangle in 0..casters.triangles.len() {
            let alone = ShadowCasters { triangles: vec![casters.triangles[triangle]], ..casters.clone() };
            let map = shadow_map(&view, &alone, SIZE);
            n_drawn.iter_mut().zip(&map.depth).for_each(|(count, &depth)| *count += u32::from(depth > 0.0));
        }
        let covered = whole.depth.iter().filter(|depth| **depth > 0.0).count();
        assert!(covered > 1000, "{covered}");
        // A sheet that never folds over in the view.
        assert_eq!(n_drawn.iter().copied().max(), Some(1));
        assert_eq!(n_drawn.iter().sum::<u32>() as usize, covered);
    }
}

#[test]
fn texels_on_an_edge_belong_to_the_top_left() {
    // Corners in texels of a view that maps x, y = -1..1 to the whole map; all texel centers on the edges.
    let view = ShadowView {
        origin: Vec3::ZERO,
        right: Vec3::X,
        up: Vec3::Y,
        forward: Vec3::NEG_Z,
        scale: Vec2::ONE,
        depth: Vec2::new(0.5, 0.0),
        w: Vec2::new(1.0, 0.0),
    };
    let corner = |x: f32, y: f32| Vec3::new(x / 32.0 - 1.0, 1.0 - y / 32.0, 0.0);
    let casters = ShadowCasters {
        positions: vec![corner(2.5, 2.5), corner(6.5, 2.5), corner(6.5, 6.5), corner(2.5, 6.5)],
        triangles: vec![[0, 1, 2], [3, 0, 2]],
        masks: None,
    };
    let map = shadow_map(&view, &casters, SIZE);
    for y in 0..8 {
        for x in 0..8 {
            let inside = (2..6).contains(&x) && (2..6).contains(&y);
            assert_eq!(map.depth[y * 64 + x] > 0.0, inside, "{x} {y}");
        }
    }
}

#[test]
fn holes_of_a_mask_stay_open_in_perspective() {
    // A quad leaning away from the light; its image has eight columns, every other one a hole.
    let positions = [(-1.0, -1.0, -1.5), (1.0, -1.0, -4.0), (1.0, 1.0, -4.0), (-1.0, 1.0, -1.5)];
    let casters = ShadowCasters {
        positions: positions.map(Vec3::from).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        masks: Some(CasterMasks {
            uv: vec![Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::X, Vec2::ZERO],
            alpha: vec![1.0; 4],
            mask: vec![0, 0],
            masks: vec![AlphaMask { image: 0, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, nearest: true, cutoff: 0.5 }],
            images: vec![AlphaImage { width: 8, height: 1, alpha: [255, 0].repeat(4) }],
        }),
    };
    assert_eq!(casters.check(), Ok(()));
    let view = view(spot(), &casters);
    let map = shadow_map(&view, &casters, SIZE);
    let mut counts = [0, 0];
    for (index, &depth) in map.depth.iter().enumerate() {
        let (x, y) = ((index as u32 % SIZE) as f64 + 0.5, (index as u32 / SIZE) as f64 + 0.5);
        let (start, way) = ray(&view, spot(), x, y);
        // The quad lies on z = -2.75 - 1.25 x.
        let normal = DVec3::new(1.25, 0.0, 1.0);
        let point = start + way * ((-2.75 - normal.dot(start)) / normal.dot(way));
        let column = (point.x + 1.0) * 4.0;
        // Texels within 0.01 of a border of column or quad may fall on either side; a texel is 0.1 columns wide.
        let near_border = (column - column.round()).abs() < 0.01 || (point.y.abs() - 1.0).abs() < 0.01;
        if near_border {
            continue;
        }
        let on_quad = (0.0..8.0).contains(&column) && point.y.abs() < 1.0;
        let present = on_quad && (column as usize).is_multiple_of(2);
        assert_eq!(depth > 0.0, present, "{index} at column {column}");
        counts[usize::from(present)] += usize::from(on_quad);
    }
    assert!(counts[0] > 200 && counts[1] > 200, "{counts:?}");
}

#[test]
fn the_number_of_tasks_does_not_matter() {
    let casters = random_casters(9, 40);
    let view = view(spot(), &casters);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(alone.install(|| shadow_map(&view, &casters, SIZE)), shadow_map(&view, &casters, SIZE));
}
