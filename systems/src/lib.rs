//! Real-time global illumination systems of other papers, on the same scenes and under the same light as a baked file.
//!
//! In: a [`World`] (rays against a scene, and what shines on it) and how many probes there may be. Out: irradiance at points, frame by
//! frame, with the bytes, rays and texels that it takes. Every system runs on the CPU by the project's own rays: its papers assume
//! hardware for them. What is compared is light and work, not milliseconds.
//!
//! The quantity is the relighter's: irradiance from surfaces, emission and sky, without what punctual lights send directly; W m^-2.
//!
//! | file | holds |
//! |---|---|
//! | [`system`] | the trait, a frame, the work that it takes |
//! | [`world`] | what rays meet and what surfaces send |
//! | [`ddgi`] | dynamic diffuse global illumination, as evaluated by Hvezda |
//! | [`ddgi_scaled`] | the same for production: states, moved probes, windows that follow the camera |
//! | [`hybrid`] | a baked file for what stands still, and a window of scaled DDGI around what moves |
//! | [`irradiance_probes`] | rays, maps and weights of octahedral irradiance probes |
//! | [`light_field`] | light field probes: rays through octahedral maps, prefiltered irradiance |
//! | [`ssgi_probes`] | spherical harmonics that learn from what is on screen |
//! | [`moving`] | things that move |
//! | [`octahedral`] | maps over all directions, with borders |
//! | [`probe_grid`] | probes at the vertices of a regular grid, the cage of a point |
//! | [`shader_light`] | the light of one frame, as a shader shades with it |

pub mod ddgi;
pub mod ddgi_scaled;
pub mod hybrid;
pub mod irradiance_probes;
pub mod light_field;
pub mod moving;
pub mod octahedral;
pub mod probe_grid;
pub mod shader_light;
pub mod ssgi_probes;
pub mod system;
pub mod world;

#[cfg(test)]
mod test_worlds;

pub use moving::{Object, moved};
pub use probe_grid::ProbeGrid;
pub use shader_light::{ShaderHarmonics, ShaderLight, ShaderProbes, Weighting};
pub use system::{Event, Feedback, Frame, Kind, Query, Setup, Shaded, System, Work};
pub use world::{Surfel, World};

/// All systems, in the order of tables.
pub static KINDS: &[&Kind] = &[
    &ddgi::KIND,
    &ddgi_scaled::KIND,
    &light_field::IRRADIANCE,
    &light_field::TRACED,
    &light_field::EXACT,
    &ssgi_probes::SSGI_PROBES,
    &ssgi_probes::SSGI_PROBES_ERROR,
    &ssgi_probes::SSGI_PROBES_OCCLUSION,
];
