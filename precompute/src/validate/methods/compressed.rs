//! What the file gives: U S V^T times the probe radiance, in f16.

use super::{Method, Prepared};

/// Ours.
pub static COMPRESSED: Method = Method {
    name: "compressed",
    title: "compressed (the file)",
    label: "ours",
    caption: "from the file, as a renderer shows it",
    comparator: None,
    prepare: |lit, _| {
        let relit = &lit.relit;
        let maps = Some(relit.maps.clone());
        Ok(Prepared { maps, ..Prepared::at_receivers(|receiver| relit.irradiance[receiver.id as usize]) })
    },
};
