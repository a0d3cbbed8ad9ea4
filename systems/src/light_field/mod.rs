//! Light field probes: radiance, normal and distance around each probe, and rays that are traced through these maps instead of the scene.
//!
//! Source: McGuire, Mara, Nowrouzezahrai and Luebke 2017, Real-Time Global Illumination using Precomputed Light Field Probes. Numbers
//! that the paper leaves to its supplement are the supplement's.
//!
//! | element | paper | file | test |
//! |---|---|---|---|
//! | octahedral distance, normal, surface of each probe | sec. 3 | `geometry.rs` | `maps_hold_what_rays_from_the_probe_meet` |
//! | radiance maps from the probes' own light of the last frame | sec. 3 | `field.rs` | `furnace_*`, `a_lamp_changes_radiance_and_not_geometry` |
//! | 8 B a texel | sec. 3 | `settings.rs` | `bytes_are_those_of_the_paper` |
//! | polyline of at most four segments | sec. 4.1, Listing 1 | `polyline.rs` | `points_of_a_ray_lie_on_its_polyline` |
//! | march over texels | sec. 4.1, Listing 1 | `polyline.rs` | `large_squares_lead_to_texels_that_small_steps_visit_too` |
//! | two-level min-mip, 1/16 per axis | sec. 4.2 | `geometry.rs`, `trace.rs` | `two_levels_answer_like_one_in_fewer_steps` |
//! | hit, miss, unknown; thickness; no back faces | sec. 4.1, Listing 1, supplement | `trace.rs` | `what_a_probe_knows_*`, `thickness_*`, `a_thin_wall_*` |
//! | first probe nearest to the ray's line | sec. 4.1 | `trace.rs` | `the_first_probe_is_nearest_to_the_line` |
//! | next probe (i + 3) mod 8, new cage on the way, end of the search | sec. 4.1, Fig. 3 | `trace.rs` | `the_next_probe_*`, `other_probes_*`, `rays_ask_the_cages_*`, `a_ray_that_gets_on_*` |
//! | brute force | sec. 5 | `field.rs` | `furnace_*`, `a_lit_plane_*` |
//! | a ray per pixel, 98 % hysteresis | sec. 5.1 | `field.rs`, `denoise.rs` | `frames_are_averaged_*`, `traced_light_settles` |
//! | bilateral filter, 12 px radius, 2 px stride | sec. 5.1 | `denoise.rs` | `edges_of_surfaces_stop_the_filter`, `noise_of_a_plane_*` |
//! | glossy ray, 3 px, 75 % | sec. 5.1 | `field.rs` | `a_mirror_shows_what_is_there` |
//! | irradiance 128^2, moments of distance 128^2 | sec. 5.2 | `prefilter.rs` | `irradiance_of_a_hemisphere_*`, `moments_of_a_wall_*`, `furnace_*` |
//! | clamped normal weight, Chebyshev, sum of weights | sec. 5.2 | `prefilter.rs` | `a_probe_behind_a_surface_*`, `a_sealed_room_*` |
//! | probes in geometry | sec. 3, sec. 6 (Fig. 10) | `trace.rs`, `prefilter.rs` | `covered_probes_*` |
//!
//! Differs from the paper:
//! - Maps are cast by rays, a ray per texel, where the paper draws cube maps. The same content.
//! - Light may change: radiance is shaded in every frame from surfaces that stay, as the paper does once ("re-rendered using their own
//!   previous lighting iterations", sec. 6), with indirect light from the prefiltered maps. It costs a shadow ray per texel and light and
//!   8 B a texel that [`Settings::probe_bytes`] does not count.
//! - Resolution of the three kinds is [`Settings::COMPARED`], 128^2 and 32^2, whatever the number of probes, so that bytes per probe are a
//!   number; [`LightField::new`] takes any.
//! - Probes stand in the middle of their parts of the scene's box, none in its sides.
//! - The march visits every texel that a segment touches, where the supplement steps a texel of the longer axis and may pass corners; and
//!   the distance along the ray is had by perspective, where it intersects lines, which fails for rays through the probe. It costs up to
//!   twice the steps on diagonals.
//! - Black backs of one-sided surfaces have no thickness behind them: what is there is free space. Otherwise rays that leave an object
//!   with a probe in it would be black.
//! - A ray around a whole cage without an answer goes around again if it got on by a centimetre; the paper leaves that open.
//! - Glossy light is there, but no figure of the comparison holds it: scenes are diffuse. Later bounces of all three kinds come from the
//!   prefiltered maps.
//! - Averages over frames are of points, not reprojected: a view that moves starts anew. Points that are no picture have this average and
//!   no spatial filter.
//! - The bilateral filter is taken in two dimensions; that of the paper's engine goes along rows and then columns.
//! - Irradiance is integrated over 32^2 means of squares of texels, not by random samples: no noise, and a small light that moves
//!   within a square does not show.

pub mod agreement;
mod denoise;
pub mod field;
pub mod geometry;
mod polyline;
pub mod prefilter;
pub mod settings;
#[cfg(test)]
mod tests;
pub mod trace;

pub use agreement::{Agreement, agreement};
pub use field::{Gather, LightField};
pub use settings::{Filter, Settings};

use crate::{Kind, Setup, System, World};

/// Prefiltered irradiance, without rays.
pub const IRRADIANCE: Kind = Kind {
    name: "light-field-irradiance",
    title: "Light field probes, prefiltered irradiance",
    prepare: |world, setup| prepare(world, setup, Gather::Prefiltered),
    ..BASE
};
/// A ray per pixel and frame, and the denoiser.
pub const TRACED: Kind = Kind {
    name: "light-field-traced",
    title: "Light field probes, ray per pixel and denoised",
    // At 98 % hysteresis what the first frame found is then 5 % of the average.
    averaged_frames: 150,
    prepare: |world, setup| prepare(world, setup, Gather::Traced),
    ..BASE
};
/// Brute force.
pub const EXACT: Kind = Kind {
    name: "light-field-exact",
    title: "Light field probes, brute force",
    prepare: |world, setup| prepare(world, setup, Gather::Exact),
    ..BASE
};

const BASE: Kind = Kind {
    name: "",
    title: "",
    source: "McGuire et al. 2017, Real-Time Global Illumination using Precomputed Light Field Probes",
    probe_bytes: Settings::COMPARED.probe_bytes(),
    follows_camera: false,
    averaged_frames: 0,
    prepare: |world, setup| prepare(world, setup, Gather::Prefiltered),
};

fn prepare(world: &World<'_>, setup: &Setup<'_>, gather: Gather) -> Box<dyn System> {
    Box::new(LightField::new(world, setup, Settings::COMPARED, gather))
}
