//! Blocks, probes, rays and receivers to the arrays of a file.

use super::{
    lay_out::LaidOut,
    leaf::{StowedLeaf, stored_members},
    transported::Transported,
};
use crate::{output::OutputError, probes::ProbeSet, relight_rays::RelightRays, settings::BakeSettings};
use localprt_formats::{BakedArrays, BlockArrays, Metadata, Probe};

/// Blocks of all leaves, one leaf after the other.
pub(super) fn stored_blocks(leaves: Vec<StowedLeaf>) -> Result<BlockArrays, OutputError> {
    let mut blocks = BlockArrays::default();
    for leaf in leaves {
        blocks.append(leaf.record, &leaf.block.get()?);
    }
    Ok(blocks)
}

/// Arrays of the file: receivers in the order of leaves and their clusters.
pub(super) fn assemble(
    LaidOut { scene, layout, receivers, .. }: &LaidOut,
    settings: &BakeSettings,
    probes: &ProbeSet,
    rays: RelightRays,
    Transported { leaves, volume, .. }: Transported,
) -> Result<BakedArrays, OutputError> {
    let mut arrays = BakedArrays {
        probes: probes
            .positions
            .iter()
            .map(|position| Probe { position: position.to_array(), support_radius_m: probes.radius_m })
            .collect(),
        ray_dirs: rays.dirs,
        ray_sh: rays.sh,
        ray_uv: rays.uv,
        ray_level: rays.level,
        ray_distance: rays.distance,
        volume,
        ..BakedArrays::default()
    };
    let mut stored = vec![u32::MAX; receivers.len()];
    for (place, &member) in stored_members(&leaves).iter().enumerate() {
        let member = member as usize;
        stored[member] = place as u32;
        arrays.receiver_texel.push(receivers.texel[member]);
        arrays.receiver_position.push(receivers.position[member].to_array());
        arrays.receiver_normal.push(receivers.normal[member].to_array());
    }
    arrays.receiver_unseen = leaves.iter().flat_map(|leaf| leaf.unseen.iter().copied()).collect();
    arrays.blocks = stored_blocks(leaves)?;
    arrays.gutters = receivers.gutters.iter().map(|&(texel, receiver)| [texel, stored[receiver as usize]]).collect();
    arrays.seams = receivers
        .seams
        .iter()
        .map(|&(a, b)| {
            let (a, b) = (stored[a as usize], stored[b as usize]);
            [a.min(b), a.max(b)]
        })
        .collect();
    arrays.seams.sort_unstable();
    let (low, high) = scene.bounds().unwrap_or_default();
    arrays.metadata = Metadata {
        tool_version: env!("CARGO_PKG_VERSION").into(),
        scene_path: String::new(),
        scene_hash: scene.hash,
        lightmap_size: layout.size,
        direct_size: settings.direct_map,
        probe_degree: settings.probe_degree,
        receiver_degree: settings.receiver_degree,
        sky_degree: settings.sky_degree,
        n_rays: settings.relight_rays,
        bounds: [low.to_array(), high.to_array()],
        options: settings.to_toml(),
    };
    Ok(arrays)
}
