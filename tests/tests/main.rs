//! Tests that cross crates, as one binary.

mod bounces;
mod budget;
mod determinism;
mod file_to_pixels;
mod furnace;
mod fuzz;
mod gpu;
mod host;
mod hybrid;
mod light_leak;
mod normal_maps;
mod sky;
mod stability;
mod validation;
mod volume;
