//! Bakes local-reconstruction precomputed radiance transfer (Silvennoinen and Lehtinen 2017).
//!
//! In: a `Scene` (world space, metres) and [`BakeSettings`]. Out, as [`BakeOutput`]: the arrays of a `.lprt` file, the scene with its
//! lightmap coordinates, and a [`BakeReport`]. [`pipeline`] is the only file that knows the order of the stages,
//! [`validate`] holds a baked file against path tracing,
//! [`reference_file`] keeps what it measured, [`cache`] keeps layouts and leaves from bake to bake ([`pipeline::bake_with`]), [`plan`] is
//! what an edited scene keeps of an earlier bake, [`shards`] deals leaves to machines, [`diff`] holds two files against each other, and
//! the `precompute` command is a thin face over all of them.
//!
//! ```no_run
//! use localprt_precompute::{Preset, Progress, bake};
//!
//! let scene = localprt_scenes::load("hall.glb")?;
//! let progress = Progress::silent();
//! let baked = bake(scene, &Preset::Preview.settings(), &progress)?;
//! println!("{} receivers, {:.1} % unseen", baked.report.receivers, 100.0 * baked.report.unseen.mean);
//! // The file has to find the scene with its lightmap coordinates, which goes beside it where they are new.
//! baked.write("hall.lprt".as_ref(), "hall.lightmap.glb".as_ref(), Some("hall.glb".as_ref()), &progress)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use localprt_surfaces::emitters;
pub use localprt_surfaces::rays;
pub use localprt_tools::{inputs, memory, metrics, output, picture, progress, reference_file};

pub mod budget;
pub mod cache;
pub mod cells;
pub mod clusters;
pub mod compress;
pub mod diff;
pub mod digest;
pub mod error;
pub mod figures;
pub mod forecast;
pub mod lightmap;
mod morton;
pub mod pipeline;
pub mod plan;
pub mod probe_views;
pub mod probes;
pub mod relight_rays;
pub mod report;
pub mod scale;
pub mod scene_digests;
pub mod scratch;
pub mod settings;
pub mod shards;
pub mod transport;
pub mod validate;
pub mod volume;
pub mod voxels;

pub use error::BakeError;
pub use pipeline::{BakeOutput, bake};
pub use progress::Progress;
pub use report::BakeReport;
pub use settings::{BakeSettings, Preset};
