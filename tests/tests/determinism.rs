//! Same input, same bytes.

use localprt_formats::to_bytes;
use localprt_precompute::settings::{BakeSettings, Transport};
use localprt_tests::{TRANSPORTS, bake, scene, small_settings};

#[test]
fn the_same_bytes_on_one_thread_and_on_three() {
    let bytes = |threads: usize, degree: u32, transport: Transport| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        let settings = BakeSettings {
            transport,
            receiver_degree: degree,
            probe_degree: 4,
            volume: Some(0.4),
            volume_degree: degree + 1,
            ..small_settings()
        };
        pool.install(|| to_bytes(&bake(scene("cornell"), &settings).arrays).expect("valid arrays"))
    };
    for (degree, transport) in [0, 1].into_iter().flat_map(|degree| TRANSPORTS.map(|transport| (degree, transport))) {
        // Equal on one thread and on three: also when it is done again.
        assert!(bytes(1, degree, transport) == bytes(3, degree, transport), "receiver degree {degree}, {transport:?}");
    }
}

#[test]
fn another_seed_gives_other_bytes() {
    let of_seed = |seed| {
        let settings = BakeSettings { seed, ..small_settings() };
        to_bytes(&bake(scene("cornell"), &settings).arrays).expect("valid arrays")
    };
    assert!(of_seed(0) != of_seed(1));
}
