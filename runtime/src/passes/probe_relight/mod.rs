//! Probe relight: the light map, read along every probe's relight rays, to SH radiance of the probes (sec. 4.2).
//!
//! In: the light map's levels and the sky along the ray directions. Out: probe radiance lambda `[n_probes, n_sh]`, RGB.

#[cfg(feature = "gpu")]
mod gpu;
mod reference;

#[cfg(feature = "gpu")]
pub(crate) use gpu::ProbeRelightPass;
pub use reference::probe_relight;
