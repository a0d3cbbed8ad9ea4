//! Irradiance probes made fit for production: probes that move out of walls and sleep, maps that follow fast, windows that follow the
//! camera.
//!
//! Source: Majercik et al. 2021, Scaling Probe-Based Real-Time Dynamic Global Illumination for Production ("the paper"). What it takes
//! from DDGI is in `irradiance_probes`.
//!
//! | element | where in the paper | file | test |
//! |---|---|---|---|
//! | query and update | 2.2, 2.3, Eq. (1) | `volume`, `field` | `a_furnace_settles_at_every_bounce`, `light_of_a_linear_sky_has_its_direction` |
//! | self-shadow bias | Eq. (2) | `volume` | `the_self_shadow_bias_goes_to_the_eye_more_than_along_the_normal`, `the_self_shadow_bias_keeps_light_in_its_room_and_too_much_does_not`, `a_moved_probe_does_not_light_the_room_that_it_left` |
//! | black backs: no light, distance shortened by 80 % | 4.1 | `irradiance_probes/rays` | `shortened_backs_hide_probes_that_are_inside` |
//! | perceptual encoding, exponent 5 | 4.2, Fig. 4 | `convergence` | `the_encoding_turns_dark_in_16_frames_instead_of_76`, `the_encoding_calms_fireflies` |
//! | thresholds 25 % and 80 % | 4.3, Fig. 5 | `convergence` | `large_changes_of_a_texel_are_taken_over_faster`, `thresholds_take_over_a_new_light_at_once` |
//! | hysteresis after events | 4.3 | `convergence` | `events_lower_hysteresis_for_as_many_frames_as_the_paper_says`, `an_event_lets_light_follow_within_its_frames`, `distances_follow_a_large_object_within_seven_frames` |
//! | second-order glossy light | 4.4, Fig. 6 | `glossy` | `glossy_light_comes_from_the_mirror_direction`, `reflections_have_light_of_the_second_order` |
//! | position optimizer | 5, Fig. 8 | `optimizer` | `a_probe_inside_goes_through_the_closest_back_to_its_limit`, `the_optimizer_moves_probes_out_of_a_block` |
//! | six states | 6, Figs. 10, 11 | `probe` | `a_sleeper_wakes_while_something_is_near_and_others_do_not_care`, `probes_far_from_surfaces_sleep_and_nobody_sees_it` |
//! | probes off | 6.1 | `probe` | `probes_deep_inside_are_off` |
//! | dynamic objects | 6.3 | `volume`, `optimizer` | `a_box_in_the_air_wakes_sleepers`, `what_moves_does_not_move_probes` |
//! | first values, more rays for them | 6.3 | `field` | `new_probes_take_their_first_values_whole_and_with_more_rays` |
//! | tracking windows | 7.2, Fig. 14 | `window` | `one_plane_leapfrogs_and_the_rest_stays_in_place`, `a_window_that_moves_keeps_what_stays` |
//! | several volumes | 7.3, Fig. 15 | `field`, `volume` | `volumes_blend_over_the_last_cell` |
//! | blending around the camera | 7.3, Fig. 17 | `volume` | `nothing_jumps_when_a_plane_leapfrogs` |
//!
//! Errors against path tracing: [`docs/systems.md`](../../../docs/systems.md), printed by `scripts/systems.sh`. The encoding darkens noisy
//! light, since a mean of roots is below the root of the mean; [`Settings::exponent`] 1 has none.
//!
//! Left out: the layout of compute shaders (7.1) and of the shading pass (7.4), which change no value; the blur of first-order glossy
//! rays on screen (4.4).
//!
//! Differs from the paper, beside what the files say where they do:
//! - Thresholds of change are shares of [`Settings::white`]: the paper's textures end at 1, radiance here does not. In a brighter scene
//!   smaller shares of its light count as a change.
//! - The last volume fills what others leave, outside of its bounds too, with its outermost probes. The paper has nothing there.
//! - Probes that are off, asleep or not yet placed do not count in a query, as sec. 6.2 implies; where all eight are, there is no light.
//! - The cage is that of the biased point: [`Settings::biased_cage`].
//! - The first five looks around are taken at once when the system is made, and are not among the work of its frames. Planes that leapfrog
//!   take them in five frames.

mod convergence;
mod field;
mod glossy;
mod optimizer;
mod probe;
mod settings;
#[cfg(test)]
mod tests;
mod volume;
mod window;

pub use convergence::{Hysteresis, Reaction};
pub use field::ScaledDdgi;
pub use optimizer::Sight;
pub use probe::{Probe, State};
pub use settings::Settings;
pub use volume::Volume;
pub use window::Window;

use crate::irradiance_probes::MapSizes;
use crate::{Kind, Setup, World};

/// The scaled system, with one volume over the scene.
pub const KIND: Kind = Kind {
    name: "ddgi-scaled",
    title: "DDGI, scaled",
    source: "Majercik et al. 2021, Scaling Probe-Based Real-Time Dynamic Global Illumination for Production",
    probe_bytes: MapSizes::PAPER.bytes() + field::STATE_BYTES,
    follows_camera: false,
    averaged_frames: 0,
    prepare: |world: &World<'_>, setup: &Setup<'_>| {
        Box::new(ScaledDdgi::over(world, setup.probes, Settings::default(), setup.seed))
    },
};
