//! Dynamic diffuse global illumination: a uniform grid of probes that trace, shade and blend in every frame, asked by weights of
//! visibility.
//!
//! Source: Hvezda, Dynamic Diffuse Global Illumination: Implementation and Evaluation ("the evaluation"), of Majercik et al. 2019 ("the
//! original"), whose numbers stand where the evaluation gives none. Every weight can be switched off.
//!
//! | element | where in the evaluation | file | test |
//! |---|---|---|---|
//! | uniform grid in the bounds | 3.1 | `probe_grid` | `every_probe_of_an_inset_grid_stands_for_an_equal_cell`, `probes_on_the_walls_would_see_outside` |
//! | octahedral irradiance 8 x 8, moments 16 x 16 | 3.1, Fig. 1 | `irradiance_probes/maps` | `irradiance_of_linear_light_is_two_thirds_of_its_slope`, `distances_are_means_over_a_narrow_lobe` |
//! | borders | Fig. 1 | `octahedral` | `reads_at_the_edge_of_the_square_need_the_border` |
//! | Fibonacci rays, turned at random | 3.2 | `irradiance_probes/rays` | `directions_are_turned_anew_in_every_frame_and_all_alike`, `turned_rays_find_what_fixed_ones_miss` |
//! | no back face culling | 3.3 | `irradiance_probes/rays` | `probes_outside_stay_dark_because_backs_are_not_culled` |
//! | surfels: direct light with shadows, indirect light of the last frame | 3.3, 3.4 | `irradiance_probes/rays` | `a_furnace_settles_at_every_bounce`, `light_in_a_sealed_room_hardly_leaks` |
//! | smooth back face weight | 3.4.1, Fig. 7c | `irradiance_probes/weights` | `each_weight_of_the_papers_figure_takes_leaking_light_away` |
//! | Chebyshev weight | 3.4.1, Fig. 7d | `irradiance_probes/weights` | the same, `without_any_one_weight_more_light_leaks` |
//! | crush of small weights | 3.4.1 | `irradiance_probes/weights` | the same two |
//! | trilinear weight | 3.4.1 | `irradiance_probes/weights` | `trilinear_weights_make_light_continuous` |
//! | normal bias | Fig. 7e | `field` | `normal_bias_brings_probes_back_into_sight_of_corners` |
//! | hysteresis | Eqs. (1), (2) | `field` | `a_lamp_takes_76_frames_to_nine_tenths` |
//! | flicker (artifact) | 3.5, 5.1 | | `low_hysteresis_and_few_rays_flicker` |
//! | delay (artifact) | 5.1 | | `a_lamp_takes_76_frames_to_nine_tenths`, `bounces_add_to_the_delay` |
//! | leaks (artifact) | 4.1, 5.1 | | `each_weight_of_the_papers_figure_takes_leaking_light_away` |
//! | over-illumination (artifact) | 4.1, 5.1 | | `what_stands_close_to_a_surface_is_overlit` |
//!
//! Errors against path tracing: [`docs/systems.md`](../../../docs/systems.md), printed by `scripts/systems.sh`.
//!
//! Differs from the paper:
//! - The outermost probes stand half a spacing within the bounds. On the faces, as vertices of a grid over the bounds would, half of
//!   their rays leave closed scenes, and the furnace has 34 to 86 % of its light. [`Settings::inset`] 0 does it.
//! - Eq. (2) prints the cosine; distances are weighted by its 50th power, as in the original, and end at 1.5 diagonals of a cell.
//! - Of `lerp(old, new, alpha)` the text after Eqs. (1) and (2) holds: an alpha near 1 changes slowly.
//! - What code of the original does beyond both papers is left out: probes are not mixed by square roots, and light is not dimmed to 85 %.
//! - Sums of Eqs. (1) and (2) are means by weight, as in the original; without, they depend on the number of rays.
//! - Shadows are rays to lights. The paper projects into shadow maps.
//! - Of [`Settings::normal_bias`] the paper gives no number and the original one in metres for its scenes; here it is a share of the
//!   spacing, and the original's part along the view is left out.
//! - Glossy and transmissive terms of the surfel buffer are not used: the quantity is diffuse.

mod field;
mod settings;
#[cfg(test)]
mod tests;

pub use field::Ddgi;
pub use settings::Settings;

use crate::irradiance_probes::MapSizes;
use crate::{Kind, Setup, World};

/// The evaluation's DDGI.
pub const KIND: Kind = Kind {
    name: "ddgi",
    title: "DDGI",
    source: "Hvezda, Dynamic Diffuse Global Illumination: Implementation and Evaluation; Majercik et al. 2019",
    probe_bytes: MapSizes::PAPER.bytes(),
    follows_camera: false,
    averaged_frames: 0,
    prepare: |world: &World<'_>, setup: &Setup<'_>| {
        Box::new(Ddgi::over(world.bounds(), setup.probes, Settings::default(), setup.seed))
    },
};
