//! Where the reconstruction is wrong, and by how much.

pub mod path_tracer;
