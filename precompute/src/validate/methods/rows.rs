//! Transport rows of the bake's own gather rays before compression, times the probe radiance.

use super::{Method, Prepared};

/// The file's rows, and its links times the light map.
pub static UNCOMPRESSED: Method = Method {
    name: "uncompressed",
    title: "uncompressed rows",
    label: "uncompressed",
    caption: "transport rows before compression",
    comparator: None,
    prepare: |_, _| Ok(Prepared::at_receivers(|receiver| receiver.transported(true, true))),
};

/// Rows as they would be without near light, which links are to be held against: the same in a file without links.
pub static WITHOUT_LINKS: Method = Method {
    name: "without_links",
    title: "rows fitted without near light, uncompressed",
    label: "without_links",
    caption: "rows fitted without near light, before compression",
    comparator: None,
    prepare: |_, _| Ok(Prepared::at_receivers(|receiver| receiver.transported(false, true))),
};

/// The paper's rows (Eqs. 4, 7): the same in a file whose rows are not fitted.
pub static PAPER: Method = Method {
    name: "paper",
    title: "the paper's rows, uncompressed",
    label: "paper",
    caption: "the paper's transport rows before compression",
    comparator: Some("transport rows of Eq. 4, whatever the file's are"),
    prepare: |_, _| Ok(Prepared::at_receivers(|receiver| receiver.transported(false, false))),
};
