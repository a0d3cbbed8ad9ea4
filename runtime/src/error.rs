//! Why a relight cannot be done.

use localprt_surfaces::rays::TreeError;

/// What is wrong with a baked file or with the inputs of one relight. What to do is [`RelightError::help`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RelightError {
    /// The direct light map has another size than the one the relight rays were baked for.
    #[error("direct light map is {found} texels wide, the file wants {expected}")]
    MapSize {
        /// `direct_size` of the file.
        expected: u32,
        /// Size of the given surface texels.
        found: u32,
    },
    /// An input array has the wrong length.
    #[error("{what} has {found} entries, needs {expected}")]
    Length {
        /// Name of the input.
        what: &'static str,
        /// Entries needed.
        expected: usize,
        /// Entries given.
        found: usize,
    },
    /// Texel indices do not rise, or lie outside of the map.
    #[error("surface texel {position} has index {index}; indices must rise and stay below {limit}")]
    TexelIndex {
        /// Where in the list.
        position: usize,
        /// The index found there.
        index: u32,
        /// Texels in the map.
        limit: u64,
    },
    /// Ends of texels' samples fall, or are not those of the samples.
    #[error("samples of surface texel {texel} end at {end}; ends must not fall, and the last must be {samples}")]
    SampleEnd {
        /// Where in the list of texels.
        texel: usize,
        /// The end found there.
        end: u32,
        /// Samples in all.
        samples: usize,
    },
    /// An input value is infinite or not a number.
    #[error("{what} {index} is not finite")]
    NotFinite {
        /// Name of the input.
        what: &'static str,
        /// Entry of that input.
        index: usize,
    },
    /// The cap on albedo in the feedback is out of range.
    #[error("feedback albedo cap is {found}, must lie in 0..=1")]
    AlbedoCap {
        /// The given cap.
        found: f32,
    },
    /// No rays can be traced in a scene.
    #[error("the scene cannot be lit: {cause}")]
    Scene {
        /// Why.
        cause: TreeError,
    },
    /// Built-in direct light without surfaces.
    #[error("no scene is set")]
    NoScene,
    /// Dynamic occluders cannot be used as given.
    #[error("dynamic occluders: {problem}")]
    Occluders {
        /// What is wrong.
        problem: String,
    },
    /// The GPU cannot hold what the file needs.
    #[error("this GPU device is too small for the file: {what} needs {needed}, the device allows {allowed}")]
    Limit {
        /// What is too large.
        what: &'static str,
        /// Needed.
        needed: u64,
        /// Allowed.
        allowed: u64,
    },
    /// The GPU device was lost.
    #[error("the GPU device does not answer: {reason}")]
    Device {
        /// As the driver tells it.
        reason: String,
    },
    /// The triangles that cast shadows contradict each other.
    #[error("shadow casters, {place}: {problem}")]
    Casters {
        /// Array and entry.
        place: String,
        /// What was found and what was allowed.
        problem: String,
    },
}

impl RelightError {
    /// What to do.
    pub fn help(&self) -> &'static str {
        match self {
            Self::MapSize { .. } => "build the surface texels at the size that the file wants",
            Self::NotFinite { .. } => "check the light, material or sky it comes from",
            Self::Scene { cause } => cause.help(),
            Self::NoScene => "call `set_scene` before using its lights, or hand in direct light another way",
            Self::Limit { .. } | Self::Device { .. } => {
                "ask for higher limits when the device is requested, or bake with fewer probes or a smaller map"
            }
            _ => "check the lighting, and bake the scene again",
        }
    }
}
