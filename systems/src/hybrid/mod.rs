//! A baked file for what stands still, and a window of traced probes around what moves: large moving geometry takes light away and gives
//! light back, and nothing is counted twice.
//!
//! Two fields of [`crate::ddgi_scaled`] stand in one window: the same probes, rays and random numbers. One traces the scene with what
//! moves, the other what stands still alone. Their difference is the change; where nothing changed it is zero to the last bit, and noise
//! and bias of both cancel. Surfaces of the file have the file's light and the change; what moves has the light of the field that has it.
//!
//! | element | file | test |
//! |---|---|---|
//! | the file relit, read at surface points by a short ray, lightmap coordinate and bilinear read | `file_light` | `the_file_is_read_where_it_has_texels_and_what_moves_has_none` |
//! | two fields, the same probes and rays | `pair` | `fields_of_equal_scenes_are_equal_to_the_last_bit`, `what_moves_is_in_one_field_alone_and_no_probe_stands_elsewhere_for_it` |
//! | the field without is taken off | `mixed` | `light_is_counted_twice_if_the_field_without_is_not_taken_off` |
//! | less light is a share of the file's, more is added | `mixed` | `light_that_is_gone_is_gone_by_its_share_whatever_the_bias`, `a_room_goes_dark_when_its_door_closes` |
//! | equal fields leave the file's light | `mixed` | `equal_fields_leave_the_files_light_to_the_last_bit`, `where_nothing_changed_the_light_is_the_files_to_the_last_bit` |
//! | fade over the last cell, but not at the scene's bounds | `region` | `the_change_falls_to_nothing_over_the_last_cell_but_not_at_walls`, `far_from_the_window_the_light_is_the_files_and_on_the_way_there_is_no_step` |
//! | the window follows what moves | `region`, `pair` | `a_window_has_one_size_wherever_things_go`, `a_window_is_renewed_if_what_moves_grows`, `a_window_follows_what_moves_and_work_and_bytes_are_of_both_fields` |
//! | what moves reads the field with it | `mixed` | `what_moves_is_lit_by_the_field_that_has_it` |
//! | shadows of what moves in the relight (off) | `mixed`, [`crate::World::with_shadows_of`] | `shadows_may_be_those_of_another_scene` |
//! | the change enters the next gather (off) | `mixed` | `bounces_of_the_change_go_on_by_the_file_beyond_the_window` |
//!
//! Found against path tracing of the changed scene, at rest: nrmse at some 400 points by area, 1,435 to 1,462 receivers and 24 probes in the
//! file, twice 80 in the window, which takes in the whole scene; as many, 184, in DDGI alone
//! (`cargo run --release -p localprt-tests --example hybrid_figures`):
//!
//! | first bounce, all | file alone | DDGI, scaled | hybrid | with shadows | passing on | four times the probes |
//! |---|---|---|---|---|---|---|
//! | two rooms, the door closes | 0.187, 0.238 | 0.287, 0.192 | 0.088, 0.087 | 0.091, 0.092 | 0.088, 0.081 | 0.090, 0.074 |
//! | a room, a wall is there | 0.438, 0.554 | 0.209, 0.136 | 0.077, 0.089 | 0.079, 0.094 | 0.077, 0.091 | 0.068, 0.081 |
//! | a court below a sky, a platform over it | 0.529, 0.363 | 0.168, 0.094 | 0.131, 0.098 | 0.131, 0.098 | 0.131, 0.090 | 0.075, 0.063 |
//!
//! The mean light of the dark room after all bounces falls from 0.267 to 0.0003 W m^-2.
//!
//! - **Where DDGI is as good.** In the open court, after all bounces, DDGI alone has the light that the hybrid has: what bounces there is
//!   smooth, and the hybrid's error is that of its fields, as many probes each as DDGI has in two.
//! - **The light that bounces.** Rays of both fields read the file's light where they meet its surfaces, with the change for the field
//!   that has what moves: all bounces are there at once, and leaks of DDGI do not feed themselves. What the change bounces comes in by
//!   and by: with the hysteresis of 0.97 that DDGI takes for noise on a screen, all of it took some 300 frames.
//! - **Shadows of what moves** may enter the relight; the field without then has them, too, and the change is what blocked rays and new
//!   surfaces make of it. It costs the direct light map to be traced in every frame, and gains nothing: the two fields find the shadow
//!   as well, but inside of the window alone. Off, since that costs nothing and takes no second set of shadows.
//! - **Passing on** adds the change to the direct light of the file's next gather, so that its bounces go on by the file beyond the window.
//!   With a window of 1 m after all bounces it is 0.202 instead of 0.217 for the door, 0.464 instead of 0.491 for the wall. It costs both
//!   fields to be asked at every texel of the light map in the window.
//! - **Sum or share.** `max(file + with - without, 0)` is at 0.160 and 0.123 instead of 0.131 and 0.098 for the platform, at 0.085 and
//!   0.095 instead of 0.077 and 0.089 for the wall; for the door at 0.087 and 0.082 instead of 0.088 and 0.087.
//! - **Reach**, after all bounces: with 1, 2, 4 and 8 m 0.491, 0.411, 0.089 and 0.089 for the wall, 0.217, 0.175, 0.087 and 0.087 for the
//!   door. What lies beyond keeps the file's light, so that the window should hold the rooms that something large stands in. 4 m did here.
//! - **Perceptual encoding** is off (exponent 1). With 5 the platform is at 0.153 and 0.101 instead of 0.131 and 0.098; door and wall are
//!   within 0.003 of what they were.
//!
//! Left out: the file's volume for what moves; one set of rays for both fields, which would halve the work; occluders of relight rays.
//! Small or thin spaces below something that moves need cells of their size: below a platform at 1.4 m, cells of 2 m lose four to six tenths
//! of the light of its lower side, cells of 0.5 m one to two.
//!
//! Feedback of another system at rest enters the relight as direct light of the texels, and both fields: of k gathers comes k + 1.

mod file_light;
mod mixed;
mod pair;
mod region;
mod settings;

pub use file_light::FileLight;
pub use mixed::Hybrid;
pub use region::Region;
pub use settings::{Joining, Settings};

/// Its key in `metrics.json`.
pub const NAME: &str = "hybrid";
/// Its row of the table.
pub const TITLE: &str = "localprt, the file and traced probes around what moves";
