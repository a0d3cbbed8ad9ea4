//! Why a scene got no layout.

use super::{MAX_SIZE, MIN_SIZE};

/// Why a scene got no layout.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UnwrapError {
    /// The receiver map is too small or too large.
    #[error("a lightmap of {texels} texels per side is out of range")]
    SizeOutOfRange {
        /// What was asked for.
        texels: u32,
    },
    /// The texel size is no length.
    #[error("a texel of {texel_m} m is no length")]
    BadTexel {
        /// What was asked for, metres.
        texel_m: f32,
    },
    /// A vertex that no surface can have.
    #[error("vertex {vertex} of mesh {mesh} is not finite")]
    NotFinite {
        /// Mesh name.
        mesh: String,
        /// Place in the source file.
        source_path: String,
        /// Vertex index.
        vertex: usize,
    },
    /// More charts than the map has room for.
    #[error("the surface falls into {charts} charts, which do not fit a lightmap of {texels} texels per side")]
    TooManyCharts {
        /// Charts.
        charts: u32,
        /// Texels per side.
        texels: u32,
    },
    /// The backend is not in this build.
    #[error("this program was built without xatlas")]
    NotBuilt,
    /// The backend refused the surface.
    #[error("{backend} could not unwrap the scene: {reason}")]
    Backend {
        /// Backend name.
        backend: &'static str,
        /// In its words.
        reason: String,
    },
    /// The backend's process failed.
    #[error("xatlas did not finish: {reason}")]
    Child {
        /// What happened to the process.
        reason: String,
    },
    /// The caller asked to stop.
    #[error("unwrapping was cancelled")]
    Cancelled,
}

impl UnwrapError {
    /// What to do.
    pub fn help(&self) -> String {
        match self {
            Self::SizeOutOfRange { .. } => format!("choose {MIN_SIZE} to {MAX_SIZE}"),
            Self::BadTexel { .. } => "choose a length above 0 m".into(),
            Self::NotFinite { .. } => "mend the vertex, or leave the mesh out".into(),
            Self::TooManyCharts { .. } => {
                "choose a larger lightmap, or join vertices that lie apart by accident".into()
            }
            Self::NotBuilt => "build it with `--features xatlas`, or unwrap with uvunwrap".into(),
            Self::Backend { .. } => "mend the mesh that it names, or give the scene a TEXCOORD_1 of its own".into(),
            Self::Child { .. } => "unwrap with uvunwrap instead".into(),
            Self::Cancelled => "start again".into(),
        }
    }
}
