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
//! Found against path tracing of the changed scene: nrmse at some 400 points by area, 1460 receivers and 24 probes in the file, twice 64
//! in the window, which takes in the whole scene; as many, 152, in DDGI alone (`figures` in `tests/tests/hybrid.rs`):
//!
//! | first bounce, all | file alone | DDGI, scaled | hybrid | with shadows | and passing on | four times the probes |
//! |---|---|---|---|---|---|---|
//! | two rooms, the door closes | 0.188, 0.238 | 0.330, 0.457 | 0.157, 0.098 | 0.160, 0.100 | 0.160, 0.111 | 0.092, 0.061 |
//! | a room, a wall is there | 0.438, 0.554 | 0.218, 0.464 | 0.143, 0.094 | 0.149, 0.088 | 0.149, 0.108 | 0.057, 0.061 |
//! | a court below a sky, a platform over it | 0.529, 0.363 | 0.172, 0.209 | 0.162, 0.137 | not measured | 0.162, 0.133 | not measured |
//!
//! Four times the probes were measured with shadows and passing on; so was the mean light of the dark room after all bounces, which falls
//! from 0.267 to 0.0016 W m^-2.
//!
//! - **The light that bounces.** Rays of both fields read the file's light where they meet its surfaces, with the change for the field
//!   that has what moves: all bounces are there at once, and leaks of DDGI do not feed themselves.
//! - **Shadows of what moves** may enter the relight; the field without then has them, too, and the change is what blocked rays and new
//!   surfaces make of it. It costs the direct light map to be traced in every frame, and neither is better by much: the two fields find
//!   the shadow as well, but inside of the window alone. Off, since that costs nothing and takes no second set of shadows.
//! - **Passing on** adds the change to the direct light of the file's next gather, so that its bounces go on by the file beyond the window.
//!   A window of 1 m around the door leaves 6 % less light too much behind it; within windows that hold all it is worse (0.111 instead of
//!   0.100). It costs both fields to be asked at every texel of the light map in the window.
//! - **Sum or share.** `max(file + with - without, 0)` leaves what the fields find too little of: for the door 0.163 and 0.121 instead of
//!   0.157 and 0.098, for the wall 0.147 and 0.168 instead of 0.143 and 0.094.
//! - **Reach**, with shadows and passing on, after all bounces: with 1, 2, 4 and 8 m 0.400, 0.298, 0.108 and 0.108 for the wall, 0.182,
//!   0.140, 0.111 and 0.111 for the door. What lies beyond keeps the file's light, so that the window should hold the rooms that something
//!   large stands in. 4 m did here.
//! - **Perceptual encoding** is off (exponent 1). With 5 and shadows and passing on the wall is at 0.126 and -8 % instead of 0.108 and
//!   +1 %, the door at 0.094 instead of 0.111.
//!
//! Left out: the file's volume for what moves; one set of rays for both fields, which would halve the work; occluders of relight rays.
//! Small or thin spaces below something that moves need cells of their size: below a platform at 1.4 m, cells of 2 m lose more than half
//! of the light of its lower side.
//!
//! Feedback of another system at rest enters the relight as direct light of the texels, and both fields: of k gathers comes k + 1.

mod file_light;
mod mixed;
mod pair;
mod region;
mod settings;

pub use file_light::FileLight;
pub use mixed::Hybrid;
pub use region::{Region, moved};
pub use settings::{Joining, Settings};
