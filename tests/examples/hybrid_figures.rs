//! The figures of the head of `systems/src/hybrid/mod.rs`: nrmse of the file, scaled DDGI and variants of the hybrid against path tracing of
//! a scene in which something has moved.
//!
//!     cargo run --release -p localprt-tests --example hybrid_figures [door|platform|wall]

use localprt_precompute::metrics::MethodError;
use localprt_systems::{
    ddgi_scaled,
    hybrid::{Joining, Settings},
};
use localprt_tests::moving::{ALL, DOOR, PLATFORM, Study, WALL, nrmse, settings};
use std::sync::LazyLock;

fn main() {
    let only = std::env::args().nth(1).unwrap_or_default();
    let studies: [(&str, &LazyLock<Study>); 3] = [("door", &DOOR), ("platform", &PLATFORM), ("wall", &WALL)];
    for (name, study) in studies.into_iter().filter(|(name, _)| only.is_empty() || only.contains(name)) {
        let clock = std::time::Instant::now();
        let study = &**study;
        let own = settings();
        let receivers = study.baked.arrays.receiver_position.len();
        println!("{name}: {receivers} receivers, {} points, bake {:?}", study.points.len(), clock.elapsed());
        for bounces in [1, ALL] {
            let clock = std::time::Instant::now();
            let truth = study.truth(bounces);
            println!("{name} {bounces}: truth {:?}", clock.elapsed());
            println!("{name} {bounces}: file {:.3}", nrmse(&study.file(bounces), &truth));
            let clock = std::time::Instant::now();
            println!(
                "{name} {bounces}: ddgi {:.3} {:?}",
                nrmse(&study.ddgi(2 * own.probes + 24, bounces), &truth),
                clock.elapsed()
            );
            let field = |exponent| ddgi_scaled::Settings { exponent, ..own.field };
            let variants = [
                ("own", own),
                ("sum", Settings { joining: Joining::Sum, ..own }),
                ("shadows", Settings { shadows: true, ..own }),
                ("passing on", Settings { passes_on: true, ..own }),
                ("both", Settings { shadows: true, passes_on: true, ..own }),
                ("passing on, reach 1", Settings { passes_on: true, reach_m: 1.0, ..own }),
                (
                    "cage as printed",
                    Settings { field: ddgi_scaled::Settings { biased_cage: false, ..own.field }, ..own },
                ),
                ("exponent 5", Settings { field: field(5.0), ..own }),
                ("sum exponent 5", Settings { joining: Joining::Sum, field: field(5.0), ..own }),
                ("double", Settings { takes_off: false, ..own }),
                ("no fade", Settings { fades: false, ..own }),
                ("reach 1", Settings { reach_m: 1.0, ..own }),
                ("reach 2", Settings { reach_m: 2.0, ..own }),
                ("reach 8", Settings { reach_m: 8.0, ..own }),
                ("probes x 4", Settings { probes: 4 * own.probes, ..own }),
            ];
            for (title, settings) in variants {
                let clock = std::time::Instant::now();
                let light = study.hybrid(settings, bounces);
                let error = MethodError::of(&light, &truth).expect("there is light");
                println!("{name} {bounces}: {title}: {:.3} bias {:.3} {:?}", error.nrmse, error.bias, clock.elapsed());
            }
        }
    }
}
