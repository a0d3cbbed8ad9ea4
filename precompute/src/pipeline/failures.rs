//! What the stages refuse, by who can act.

use crate::{
    error::BakeError, lightmap::unwrap::UnwrapError, probes::PlacementError, progress::Cancelled, rays::TreeError,
    voxels::VoxelError,
};

pub(super) fn tree_error(error: TreeError) -> BakeError {
    BakeError::Scene {
        what: error.to_string(),
        place: None,
        remedy: "remove stray far-away or microscopic geometry".into(),
    }
}

pub(super) fn voxel_error(error: VoxelError) -> BakeError {
    stage_error(&error.to_string(), matches!(error, VoxelError::EmptyScene | VoxelError::NotFinite { .. }))
}

pub(super) fn placement_error(error: PlacementError) -> BakeError {
    use PlacementError as E;
    let of_scene = matches!(error, E::NoOpenSpace { .. } | E::NoCandidate { .. } | E::NoReceivers);
    stage_error(&error.to_string(), of_scene)
}

pub(super) fn unwrap_error(error: UnwrapError) -> BakeError {
    match error {
        UnwrapError::Cancelled => BakeError::Cancelled(Cancelled),
        UnwrapError::NotBuilt => {
            BakeError::Unsupported { what: error.to_string(), remedy: "use the default unwrap backend".into() }
        }
        UnwrapError::NotFinite { .. } | UnwrapError::Backend { .. } => stage_error(&error.to_string(), true),
        _ => stage_error(&error.to_string(), false),
    }
}

/// The stages' messages end in `: REMEDY`.
fn stage_error(message: &str, of_scene: bool) -> BakeError {
    let (what, remedy) = message.rsplit_once(": ").unwrap_or((message, "see precompute bake --help"));
    let (what, remedy) = (what.to_owned(), remedy.to_owned());
    if of_scene { BakeError::Scene { what, place: None, remedy } } else { BakeError::Option { what, remedy } }
}
