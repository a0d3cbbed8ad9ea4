//! Direct light through shadow maps: the twins against traced shadows, the GPU against the twins.

#[cfg(feature = "gpu")]
mod on_gpu;
mod scenes;
mod twins;
