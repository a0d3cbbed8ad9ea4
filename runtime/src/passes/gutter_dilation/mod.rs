//! Gutter dilation: receiver irradiance to a map that can be read bilinearly, gutters filled from their own chart.
//!
//! In: irradiance `[n_receivers]`. Out: the receiver map, coverage 1 where a receiver or a gutter texel is.

#[cfg(feature = "gpu")]
mod gpu;
mod reference;

#[cfg(feature = "gpu")]
pub(crate) use gpu::{GutterDilationPass, ReceiverMaps};
pub use reference::gutter_dilation;
