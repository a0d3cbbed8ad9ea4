//! What the stages refuse, by who can act.

use crate::{
    error::BakeError, lightmap::unwrap::UnwrapError, probes::PlacementError, progress::Cancelled, rays::TreeError,
    voxels::VoxelError,
};

pub(super) fn tree_error(error: TreeError) -> BakeError {
    stage_error(error.to_string(), error.help().into(), true)
}

pub(super) fn voxel_error(error: VoxelError) -> BakeError {
    stage_error(error.to_string(), error.help(), error.is_of_scene())
}

pub(super) fn placement_error(error: PlacementError) -> BakeError {
    stage_error(error.to_string(), error.help(), error.is_of_scene())
}

pub(super) fn unwrap_error(error: UnwrapError) -> BakeError {
    let (what, remedy) = (error.to_string(), error.help());
    match error {
        UnwrapError::Cancelled => BakeError::Cancelled(Cancelled),
        UnwrapError::NotBuilt => BakeError::Unsupported { what, remedy },
        UnwrapError::NotFinite { source_path, .. } => BakeError::Scene { what, place: Some(source_path), remedy },
        UnwrapError::Backend { .. } => stage_error(what, remedy, true),
        _ => stage_error(what, remedy, false),
    }
}

fn stage_error(what: String, remedy: String, of_scene: bool) -> BakeError {
    if of_scene { BakeError::Scene { what, place: None, remedy } } else { BakeError::Option { what, remedy } }
}
