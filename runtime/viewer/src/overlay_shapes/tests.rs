use super::*;
use half::f16;
use localprt_formats::{
    BakedArrays, BlockArrays, ClusterRecord, LEVEL_BLACK, Metadata, NearArrays, NearTile, TransportBlock,
};

fn halves(values: &[f32]) -> Vec<f16> {
    values.iter().map(|&value| f16::from_f32(value)).collect()
}

/// Two probes of degree 0, a sky of degree 0. The rows of the receivers' transport are (3, 4, 12) and (0, 4, 0); the third
/// sees nothing.
fn baked() -> BakedArrays {
    let n_rays = 100;
    let mut arrays = BakedArrays {
        metadata: Metadata {
            n_rays,
            lightmap_size: 2,
            direct_size: 8,
            bounds: [[0.0; 3], [10.0; 3]],
            ..Metadata::default()
        },
        probes: vec![
            Probe { position: [0.0, 1.0, 0.0], support_radius_m: 2.0 },
            Probe { position: [3.0, 0.0, 0.0], support_radius_m: 2.0 },
        ],
        ray_dirs: (0..n_rays)
            .map(|ray| localprt_formats::directions::spherical_fibonacci(ray, n_rays))
            .map(|[x, y, z]| [x, y, z, 0.0])
            .collect(),
        ray_sh: vec![0.0; 100],
        ray_uv: vec![0; 200],
        ray_level: (0..200).map(|ray| [3, LEVEL_SKY, LEVEL_BLACK][ray % 3]).collect(),
        ray_distance: (0..200).map(|ray| f16::from_f32([1.5, f32::INFINITY, 0.5][ray % 3])).collect(),
        receiver_texel: vec![0, 1, 2],
        receiver_position: vec![[0.0; 3]; 3],
        receiver_normal: vec![[0.0, 1.0, 0.0]; 3],
        receiver_unseen: vec![0.0; 3],
        ..BakedArrays::default()
    };
    set_block(&mut arrays, &halves(&[3.0, 0.0, 12.0, 0.0, 4.0, 0.0]), &halves(&[1.0, 1.0, 0.0, 1.0]), None);
    arrays
}

/// Two receivers over both probes and the sky, and one that sees nothing.
fn set_block(arrays: &mut BakedArrays, projection: &[f16], reconstruction: &[f16], near: Option<NearArrays>) {
    let mut block = TransportBlock::default();
    let n_sky = arrays.metadata.n_sky() as u32;
    let record = ClusterRecord { n_receivers: 2, n_probes: 2, n_sky, n_coefficients: 2 };
    block.push(record, &[0, 1], projection, reconstruction);
    block.push(ClusterRecord { n_receivers: 1, ..ClusterRecord::default() }, &[], &[], &[]);
    block.near = near.unwrap_or_default();
    arrays.blocks = BlockArrays::of_one(&block, &arrays.receiver_position, arrays.metadata.n_k());
}

#[test]
fn shares_of_a_transport_row_are_those_of_its_squares() {
    let baked = baked();
    let support = supporting_probes(&baked.checked().expect("a sound file"), 0);
    let found: Vec<_> = support.probes.iter().map(|probe| (probe.probe, probe.row_share)).collect();
    assert_eq!(found, [(1, 16.0 / 169.0), (0, 9.0 / 169.0)]);
    assert_eq!(support.sky_share, 144.0 / 169.0);
    // Half of the support radius away, and outside of the support.
    let places: Vec<_> = support.probes.iter().map(|probe| (probe.distance_m, probe.kernel_weight)).collect();
    assert_eq!(places, [(3.0, 0.0), (1.0, 0.5)]);

    let second = supporting_probes(&baked.checked().expect("a sound file"), 1);
    assert_eq!((second.probes[0].probe, second.probes[0].row_share, second.sky_share), (1, 1.0, 0.0));
    assert_eq!(supporting_probes(&baked.checked().expect("a sound file"), 2), Support::default());
    assert_eq!(supporting_probes(&baked.checked().expect("a sound file"), 99), Support::default());
}

#[test]
fn shares_add_up_to_one_over_all_outputs_of_a_receiver() {
    // Two outputs of four each, over probes of degree 1: any numbers.
    let mut baked = baked();
    (baked.metadata.probe_degree, baked.metadata.receiver_degree) = (1, 1);
    let number = |index: u32| ((index * 7919) % 23) as f32 - 11.0;
    baked.ray_sh = vec![0.0; 400];
    let projection = halves(&(0..2 * 9).map(number).collect::<Vec<_>>());
    let reconstruction = halves(&(5..5 + 2 * 4 * 2).map(number).collect::<Vec<_>>());
    set_block(&mut baked, &projection, &reconstruction, None);
    for receiver in 0..2 {
        let support = supporting_probes(&baked.checked().expect("a sound file"), receiver);
        let shares: f32 = support.probes.iter().map(|probe| probe.row_share).sum();
        assert!((shares + support.sky_share - 1.0).abs() < 1e-6, "{support:?}");
        assert!(support.probes[0].row_share >= support.probes[1].row_share);
    }
}

#[test]
fn a_receiver_shows_its_normal_and_its_probes() {
    let baked = baked();
    let lines = receiver_lines(&baked.checked().expect("a sound file"), 0);
    assert!(
        lines.iter().all(|line| line.from.is_finite() && line.color.iter().all(|value| (0.0..=1.0).contains(value)))
    );
    let ends: Vec<Vec3> = lines.iter().filter(|line| line.from == Vec3::ZERO).map(|line| line.to).collect();
    assert_eq!(ends, [Vec3::new(3.0, 0.0, 0.0), Vec3::Y, 0.4 * Vec3::Y]);
    assert!(lines[1].width_px > lines[0].width_px, "the nearer probe weighs more");
    assert!(
        !receiver_lines(&baked.checked().expect("a sound file"), 2).is_empty(),
        "a receiver without probes has a normal"
    );
    assert!(receiver_lines(&baked.checked().expect("a sound file"), 4).is_empty());
}

#[test]
fn rays_end_where_the_file_says() {
    let mut baked = baked();
    let lines = probe_rays(&baked.view(), 1, 1000);
    assert_eq!(lines.len(), 100);
    for (ray, line) in lines.iter().enumerate() {
        let (length, color) = [(1.5, WHITE), (2.0, SKY_BLUE), (0.5, RED)][(100 + ray) % 3];
        assert!((line.from.distance(line.to) - length).abs() < 1e-5);
        assert_eq!(line.color[..3], color);
        assert_eq!(line.from, Vec3::new(3.0, 0.0, 0.0));
    }
    let few = probe_rays(&baked.view(), 1, 9);
    assert_eq!(few.len(), 9);
    let mean: Vec3 = few.iter().map(|line| (line.to - line.from).normalize() / 9.0).sum();
    assert!(mean.length() < 0.25, "spread over the sphere: {mean}");
    baked.ray_distance.clear();
    assert!(probe_rays(&baked.view(), 0, 1000).iter().all(|line| (line.from.distance(line.to) - 2.0).abs() < 1e-5));
    assert!(probe_rays(&baked.view(), 2, 1000).is_empty());
    assert!(probe_rays(&baked.view(), 0, 0).is_empty());
}

#[test]
fn a_support_sphere_lies_where_weights_end() {
    let probe = baked().probes[1];
    let lines = support_sphere(&probe);
    assert_eq!(lines.len(), 3 * SEGMENTS);
    for end in lines.iter().flat_map(|line| [line.from, line.to]) {
        assert!((end.distance(probe.position.into()) - 2.0).abs() < 1e-5);
    }
}

#[test]
fn lights_are_shown_where_they_are_and_how_they_shine() {
    let place = Vec3::new(1.0, 2.0, 3.0);
    let dir = Vec3::new(1.0, -2.0, 0.5).normalize();
    let light = |kind| Light {
        name: String::new(),
        kind,
        position: place,
        direction: dir,
        color: Vec3::new(2.0, 1.0, 0.0),
        intensity: 1.0,
        range: None,
    };
    let anchor = Vec3::splat(-4.0);
    let ends = |kind| {
        let lines = light_shape(&light(kind), anchor, 0.5, false);
        assert!(lines.iter().all(|line| line.color == [1.0, 0.5, 0.0, 1.0]));
        lines.iter().flat_map(|line| [line.from, line.to]).collect::<Vec<_>>()
    };
    let reach = |points: &[Vec3], from: Vec3| points.iter().map(|point| point.distance(from)).fold(0.0, f32::max);
    assert!((reach(&ends(LightKind::Point), place) - 0.5).abs() < 1e-5);
    assert!(reach(&ends(LightKind::Directional), anchor) < 1.2 * 0.5);

    let (inner_cone, outer_cone) = (0.3, 0.8);
    let cone = ends(LightKind::Spot { inner_cone, outer_cone });
    for point in cone.iter().filter(|point| point.distance(place) > 0.0) {
        let angle = (*point - place).angle_between(dir);
        assert!((point.distance(place) - 1.0).abs() < 1e-5);
        assert!([0.0, inner_cone, outer_cone].iter().any(|known| (angle - known).abs() < 2e-3), "{angle}");
    }
    let selected = light_shape(&light(LightKind::Point), anchor, 0.5, true);
    assert!(selected.iter().all(|line| line.color[..3] == ORANGE));
}

#[test]
fn weights_have_colors_from_end_to_end() {
    assert_eq!(weight_color(-1.0), weight_color(0.0));
    assert_eq!(weight_color(2.0), weight_color(1.0));
    let luminance = |weight: f32| Vec3::from(weight_color(weight)).dot(Vec3::new(0.2126, 0.7152, 0.0722));
    for step in 0..20 {
        let weight = step as f32 / 20.0;
        assert!(luminance(weight) < luminance(weight + 0.05), "at {weight}");
    }
}

#[test]
fn links_go_to_the_middle_of_what_their_nodes_cover() {
    let mut baked = baked();
    baked.metadata.direct_size = 4;
    baked.ray_level.fill(LEVEL_SKY);
    // A texel of the map, and the level above over four of which one is covered.
    let near = NearArrays {
        tiles: vec![NearTile { n_receivers: 3, n_nodes: 2, n_links: 2, scale: 1.0 }],
        nodes: vec![5, 1 << 28 | 1],
        counts: vec![2, 0, 0],
        links: vec![0, 1],
        weights: vec![127, 64],
    };
    set_block(&mut baked, &halves(&[0.0; 6]), &halves(&[0.0; 4]), Some(near));
    let baked = baked.checked().expect("a sound file");
    let texels = SceneTexels {
        size: 4,
        index: vec![2, 5],
        position: vec![Vec3::new(0.0, 3.0, 0.0), Vec3::new(1.0, 0.0, 2.0)],
        ..SceneTexels::default()
    };
    let lines = link_lines(&baked, &texels, 0);
    assert_eq!(lines.iter().map(|line| line.to).collect::<Vec<_>>(), [texels.position[0], texels.position[1]]);
    assert!(lines[1].width_px > lines[0].width_px, "the strongest is last and thickest");
    assert!(link_lines(&baked, &texels, 1).is_empty() && link_lines(&baked, &texels, 9).is_empty());
}
