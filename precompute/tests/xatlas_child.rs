//! xatlas in its child process: this program starts itself, as `precompute` does.

use glam::Vec2;
use localprt_precompute::lightmap::unwrap::xatlas::CHILD_ARGUMENT;
use localprt_precompute::lightmap::unwrap::{Piece, UnwrapError, Unwrapped, Unwrapper, XatlasChild, xatlas_child_main};
use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Duration;

fn main() -> ExitCode {
    if std::env::args().nth(1).as_deref() == Some(CHILD_ARGUMENT) {
        return xatlas_child_main();
    }
    for (name, test) in TESTS {
        test();
        println!("test {name} ... ok");
    }
    ExitCode::SUCCESS
}

const TESTS: [(&str, fn()); 4] = [
    ("charts_are_two_texels_apart", charts_are_two_texels_apart),
    ("texels_have_the_size_asked_for", texels_have_the_size_asked_for),
    ("surfaces_that_end_xatlas_are_an_error", surfaces_that_end_xatlas_are_an_error),
    ("a_child_that_takes_too_long_is_ended", a_child_that_takes_too_long_is_ended),
];

fn quiet(_: &str, _: usize, _: usize) -> bool {
    true
}

/// A field of hills, and a box.
fn pieces() -> Vec<Piece> {
    let mut hills = Piece::default();
    for z in 0..40u32 {
        for x in 0..40u32 {
            let (u, v) = (x as f32 / 4.0, z as f32 / 4.0);
            hills.positions.push([u, (u * 1.3).sin() * (v * 1.7).cos(), v]);
            if x < 39 && z < 39 {
                let a = z * 40 + x;
                hills.triangles.extend([[a, a + 40, a + 41], [a, a + 41, a + 1]]);
            }
        }
    }
    let mut block = Piece::default();
    for corner in 0..8u32 {
        block.positions.push([0, 1, 2].map(|axis| (corner >> axis & 1) as f32 * 2.0));
    }
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        block.triangles.extend([[a, b, c], [a, c, d]]);
    }
    vec![hills, Piece::default(), block]
}

fn charts_are_two_texels_apart() {
    let pieces = pieces();
    let unwrap = || XatlasChild::new().unwrap().unwrap(&pieces, 16.0, &quiet).unwrap();
    let unwrapped = unwrap();
    assert!(unwrapped.corners.iter().flatten().all(Option::is_some));
    assert_gaps(&unwrapped);
    let again = unwrap();
    assert!(again.corners == unwrapped.corners, "two runs differ");
}

/// Marks the texels under points all over each face and asks for two empty ones between charts, which are faces joined
/// by corners.
fn assert_gaps(unwrapped: &Unwrapped) {
    let mut chart_of: BTreeMap<(usize, [u32; 2]), usize> = BTreeMap::new();
    let mut owner: BTreeMap<(i32, i32), usize> = BTreeMap::new();
    let mut parent: Vec<usize> = Vec::new();
    fn root(parent: &[usize], mut set: usize) -> usize {
        while parent[set] != set {
            set = parent[set];
        }
        set
    }
    for (piece, triangles) in unwrapped.corners.iter().enumerate() {
        for triangle in triangles.iter().flatten() {
            let mut set = parent.len();
            parent.push(set);
            for corner in triangle {
                let held = *chart_of.entry((piece, corner.to_array().map(f32::to_bits))).or_insert(set);
                let (low, high) =
                    (root(&parent, held).min(root(&parent, set)), root(&parent, held).max(root(&parent, set)));
                parent[high] = low;
                set = low;
            }
            let [a, b, c] = *triangle;
            let steps = 4 * ((b - a).length().max((c - a).length()).ceil() as i32 + 1);
            for i in 0..=steps {
                for j in 0..=steps - i {
                    let point: Vec2 = a + (b - a) * (i as f32 / steps as f32) + (c - a) * (j as f32 / steps as f32);
                    owner.insert((point.x.floor() as i32, point.y.floor() as i32), set);
                }
            }
        }
    }
    assert!(owner.len() > 1000);
    for (&(x, y), &set) in &owner {
        for (dx, dy) in (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy))) {
            if let Some(&other) = owner.get(&(x + dx, y + dy)) {
                assert_eq!(root(&parent, other), root(&parent, set), "charts touch at {x} {y}");
            }
        }
    }
}

fn texels_have_the_size_asked_for() {
    let pieces = pieces();
    let unwrapped = XatlasChild::new().unwrap().unwrap(&pieces, 8.0, &quiet).unwrap();
    // The box's 24 m^2 at 8 texels per metre, flat: nothing but rounding.
    let used: f32 =
        unwrapped.corners[2].iter().flatten().map(|t| (t[1] - t[0]).perp_dot(t[2] - t[0]).abs() / 2.0).sum();
    assert!((used / (24.0 * 64.0) - 1.0).abs() < 0.01, "{used} texels");
}

fn surfaces_that_end_xatlas_are_an_error() {
    let mut infinite = pieces();
    infinite[0].positions[7] = [f32::INFINITY, 0.0, 0.0];
    let mut astray = pieces();
    astray[2].triangles[3] = [0, 1, 4_000_000];
    // A million metres at 16 texels per metre.
    let mut huge = pieces();
    for position in &mut huge[0].positions {
        *position = position.map(|value| value * 1e5);
    }
    for pieces in [infinite, astray, huge] {
        let child = XatlasChild { time_limit: Duration::from_secs(60), ..XatlasChild::new().unwrap() };
        let error = child.unwrap(&pieces, 16.0, &quiet).unwrap_err();
        assert!(matches!(error, UnwrapError::Child { .. }), "{error}");
        println!("  {error}");
    }
}

fn a_child_that_takes_too_long_is_ended() {
    let child = XatlasChild { time_limit: Duration::ZERO, ..XatlasChild::new().unwrap() };
    let error = child.unwrap(&pieces(), 16.0, &quiet).unwrap_err();
    assert!(error.to_string().contains("ended after"), "{error}");
    let stopped = XatlasChild::new().unwrap().unwrap(&pieces(), 16.0, &|_, _, _| false);
    assert!(matches!(stopped, Err(UnwrapError::Cancelled)));
}
