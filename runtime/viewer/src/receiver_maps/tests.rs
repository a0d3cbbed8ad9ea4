use super::*;
use localprt_formats::{BakedArrays, BlockArrays, ClusterRecord, Metadata, TransportBlock};
use localprt_tools::reference_file::ReferencePoint;

const GRAY: [u8; 4] = [128, 128, 128, 255];
const NOTHING: [u8; 4] = [0; 4];

/// Four texels a side. Cluster 0: a row of receivers 0 to 3 in the first row, x = 0 to 3 m; cluster 1: receivers 4 and 5
/// below the first two; cluster 2: receiver 6 in the last texel, looking down. Texel 8 is receiver 4's gutter.
fn baked() -> BakedArrays {
    let at = |x: f32, z: f32| [x, 0.0, z];
    let mut arrays = BakedArrays {
        receiver_texel: vec![0, 1, 2, 3, 4, 5, 15],
        receiver_position: vec![
            at(0.0, 0.0),
            at(1.0, 0.0),
            at(2.0, 0.0),
            at(3.0, 0.0),
            at(0.0, 1.0),
            at(1.0, 1.0),
            at(3.0, 3.0),
        ],
        receiver_normal: [vec![[0.0, 1.0, 0.0]; 6], vec![[0.0, -1.0, 0.0]]].concat(),
        receiver_unseen: vec![0.0, 0.05, 0.1, 0.2, 0.0, 0.0, 0.0],
        gutters: vec![[8, 4]],
        ..without_probes(4)
    };
    arrays.blocks = blocks(&[(4, 5), (2, 10), (1, 0)], &arrays.receiver_position);
    arrays
}

/// A map of so many texels a side, without receivers.
fn without_probes(lightmap_size: u32) -> BakedArrays {
    let bounds = [[0.0, 0.0, 0.0], [4.0, 1.0, 4.0]];
    BakedArrays {
        metadata: Metadata { lightmap_size, direct_size: 1, n_rays: 1, bounds, ..Metadata::default() },
        ray_dirs: vec![[0.0, 1.0, 0.0, 0.0]],
        ray_sh: vec![1.0],
        ..BakedArrays::default()
    }
}

/// Clusters of so many receivers and coefficients that read the sky.
fn blocks(clusters: &[(u32, u32)], positions: &[[f32; 3]]) -> BlockArrays {
    let mut block = TransportBlock::default();
    for &(n_receivers, n_coefficients) in clusters {
        let zeros = |count: u32| vec![half::f16::ZERO; count as usize];
        let record = ClusterRecord { n_receivers, n_probes: 0, n_sky: 1, n_coefficients };
        block.push(record, &[], &zeros(n_coefficients), &zeros(n_coefficients * n_receivers));
    }
    BlockArrays::of_one(&block, positions, 1)
}

fn reference(errors: &[(u32, f32)]) -> ReferenceFile {
    // A reference of 1 everywhere: the error is what is more.
    let point = |&(receiver, error): &(u32, f32)| ReferencePoint {
        receiver,
        reference: [1.0; 3],
        compressed: [1.0 + error; 3],
        ..Default::default()
    };
    ReferenceFile {
        content_hash: [0; 32],
        state: "noon".into(),
        bounces: 3,
        points: errors.iter().map(point).collect(),
    }
}

fn texel(map: &ReceiverMap, texel: usize) -> [u8; 4] {
    map.rgba[4 * texel..][..4].try_into().expect("four bytes")
}

fn ramp(t: f32) -> [u8; 4] {
    let [red, green, blue] = Ramp::Sequential.color(t);
    [red, green, blue, 255]
}

fn shown(view: ViewKind, reference: Option<&ReferenceFile>) -> ReceiverMap {
    receiver_map(view, &baked().checked().expect("a sound file"), reference).expect("a map")
}

#[test]
fn maps_are_there_for_map_views_alone() {
    let measured = reference(&[(0, 0.0)]);
    for view in ViewKind::ALL {
        let map = receiver_map(view, &baked().checked().expect("a sound file"), Some(&measured));
        assert_eq!(map.is_some(), view.is_map(), "{}", view.name());
        let Some(map) = map else { continue };
        assert_eq!((map.size, map.rgba.len()), (4, 64));
        assert!(map.legend.colors.is_empty() || map.legend.low < map.legend.high);
        assert!(!map.legend.title.is_empty() && !map.legend.note.is_empty());
    }
    assert_eq!(receiver_map(ViewKind::Error, &baked().checked().expect("a sound file"), None), None);
    let empty = without_probes(1);
    for view in ViewKind::ALL {
        let map = receiver_map(view, &empty.checked().expect("a sound file"), Some(&measured));
        assert!(map.is_none_or(|map| map.rgba.len() == 4));
    }
}

#[test]
fn unseen_light_is_on_a_ramp_and_gutters_follow_their_receivers() {
    let map = shown(ViewKind::Unseen, None);
    assert_eq!((map.legend.low, map.legend.high), (0.0, 0.2));
    let found = [0, 1, 2, 3, 4, 8, 9, 15].map(|at| texel(&map, at));
    assert_eq!(found, [ramp(0.0), ramp(0.25), ramp(0.5), ramp(1.0), ramp(0.0), ramp(0.0), NOTHING, ramp(0.0)]);
    assert_eq!(
        (map.legend.colors[0], map.legend.colors[63]),
        (Ramp::Sequential.color(0.0), Ramp::Sequential.color(1.0))
    );
    // 0.35 over seven receivers.
    assert_eq!(map.legend.note, "mean 5.00 %, p95 20.00 %, max 20.00 %");
}

#[test]
fn coefficients_are_those_of_the_cluster() {
    let map = shown(ViewKind::Coefficients, None);
    assert_eq!(map.legend.high, 10.0);
    assert_eq!([0, 3, 5, 8, 15].map(|at| texel(&map, at)), [ramp(0.5), ramp(0.5), ramp(1.0), ramp(1.0), ramp(0.0)]);
}

#[test]
fn clusters_side_by_side_differ() {
    let map = shown(ViewKind::Clusters, None);
    assert_eq!(texel(&map, 0), texel(&map, 3));
    assert_eq!(texel(&map, 4), texel(&map, 8));
    assert_ne!(texel(&map, 0), texel(&map, 4));
    assert!(map.legend.note.starts_with("3 clusters of 2 receivers"), "{}", map.legend.note);
    assert_eq!(map, shown(ViewKind::Clusters, None), "the same every time");

    // Every texel its own cluster, all in a seam with the first: no two neighbors alike.
    let side = 24u32;
    let count = side * side;
    let positions = vec![[0.0; 3]; count as usize];
    let arrays = BakedArrays {
        receiver_texel: (0..count).collect(),
        receiver_normal: vec![[0.0, 1.0, 0.0]; count as usize],
        receiver_unseen: vec![0.0; count as usize],
        blocks: blocks(&vec![(1, 0); count as usize], &positions),
        receiver_position: positions,
        seams: (1..count).map(|receiver| [0, receiver]).collect(),
        ..without_probes(side)
    };
    let colors = clusters::colors(&arrays.checked().expect("a sound file"));
    for texel in 0..count {
        let (x, y) = (texel % side, texel / side);
        let color = colors[texel as usize];
        assert!(x + 1 == side || color != colors[texel as usize + 1]);
        assert!(y + 1 == side || color != colors[(texel + side) as usize]);
        assert!(texel == 0 || color != colors[0]);
    }
    let used = clusters::PALETTE.iter().filter(|&color| colors.contains(color)).count();
    assert_eq!(used, clusters::PALETTE.len());
}

#[test]
fn texels_are_a_checkerboard_with_gutters_and_empty_ones_marked() {
    let (map, clusters) = (shown(ViewKind::Texels, None), shown(ViewKind::Clusters, None));
    for (at, is_dark) in [(0, false), (1, true), (2, false), (4, true), (5, false), (15, false)] {
        let [red, green, blue, _] = texel(&clusters, at);
        let shade = |value: u8| {
            let pale = (f32::from(value) + 200.0) / 2.0;
            (if is_dark { 0.6 * pale } else { pale }).round() as u8
        };
        assert_eq!(texel(&map, at), [shade(red), shade(green), shade(blue), 255], "{at}");
    }
    assert_eq!([8, 9].map(|at| texel(&map, at)), [[255; 4], [0, 0, 0, 255]]);
}

#[test]
fn errors_are_relative_and_spread_within_the_cluster() {
    // Steps of a quarter are exact; luminance weights sum to 1 within f32's rounding.
    let map = shown(ViewKind::Error, Some(&reference(&[(0, 0.25), (3, 1.0)])));
    assert_eq!((map.legend.low, map.legend.high), (0.0, 1.0));
    assert_eq!([0, 1, 2, 3].map(|at| texel(&map, at)), [ramp(0.25), ramp(0.25), ramp(1.0), ramp(1.0)]);
    // Nothing is measured in the other clusters: the nearest one around speaks for what faces the same way.
    assert_eq!([4, 5, 8].map(|at| texel(&map, at)), [ramp(0.25); 3]);
    assert_eq!(texel(&map, 15), GRAY);
    assert!(map.legend.note.ends_with("at 2 of 7 receivers; 3 bounces under noon"), "{}", map.legend.note);
}

#[test]
fn far_away_nothing_is_guessed() {
    let mut arrays = baked();
    arrays.receiver_position[4] = [0.0, 0.0, 500.0];
    arrays.blocks = blocks(&[(4, 5), (2, 10), (1, 0)], &arrays.receiver_position);
    let arrays = arrays.checked().expect("a sound file");
    let values = error::everywhere(&arrays, &[(0, 0.5)]);
    assert_eq!(values[..4], [0.5; 4]);
    assert!(values[4].is_nan() && values[5] == 0.5 && values[6].is_nan(), "{values:?}");
    // Receivers that the file does not have are no reason to panic.
    let values = error::everywhere(&arrays, &[(0, 0.5), (900, 0.25)]);
    assert_eq!(values[..4], [0.5; 4]);
}
