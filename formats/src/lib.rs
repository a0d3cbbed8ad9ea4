//! Baked transport files of localprt: open, check, write; and the conventions that give their numbers meaning.
//!
//! In goes what a bake made, as plain arrays ([`BakedArrays`]) with transport in blocks of some hundred receivers
//! ([`TransportBlock`]); out comes a `.lprt` file, and from such a file the same arrays as borrowed slices ([`BakedView`]) that lie
//! in the mapped file and upload to a GPU as they are. Opening checks every count and every index outside of the blocks;
//! [`Baked::checked`] checks all blocks and gives the type that relighters take ([`Checked`]), [`Baked::block`] one;
//! [`check()`] verifies the checksums too. The layout, rule by rule, and how to relight from the numbers: `SPEC.md` beside this
//! crate's manifest.
//!
//! World space, metres, +Y up; radiance in W sr^-1 m^-2, linear Rec. 709. SH signs and index order: [`sh`].
//!
//! ```
//! use localprt_formats::{
//!     Baked, BakedArrays, BlockArrays, ClusterRecord, LEVEL_SKY, Metadata, Probe, TransportBlock, quantize, sh,
//! };
//!
//! // One probe with one relight ray, straight up to the sky, and one receiver that takes its light from that probe.
//! let mut ray_sh = [0.0; 4];
//! sh::Basis::new(1).evaluate([0.0, 1.0, 0.0], &mut ray_sh);
//! let mut block = TransportBlock::default();
//! block.push(
//!     ClusterRecord { n_receivers: 1, n_probes: 1, n_sky: 0, n_coefficients: 1 },
//!     &[0],
//!     &quantize::to_f16_block(&[0.9, 1.0, 0.0, 0.0])?,
//!     &quantize::to_f16_block(&[1.0])?,
//! );
//! let arrays = BakedArrays {
//!     metadata: Metadata { probe_degree: 1, lightmap_size: 4, direct_size: 4, n_rays: 1, ..Metadata::default() },
//!     probes: vec![Probe { position: [0.0, 1.0, 0.0], support_radius_m: 2.0 }],
//!     ray_dirs: vec![[0.0, 1.0, 0.0, 0.0]],
//!     ray_sh: ray_sh.map(|value| value * 4.0 * std::f32::consts::PI).to_vec(),
//!     ray_uv: vec![0],
//!     ray_level: vec![LEVEL_SKY],
//!     receiver_texel: vec![5],
//!     receiver_position: vec![[0.0, 0.0, 0.0]],
//!     receiver_normal: vec![[0.0, 1.0, 0.0]],
//!     receiver_unseen: vec![0.0],
//!     blocks: BlockArrays::of_one(&block, &[[0.0, 0.0, 0.0]], 1),
//!     ..BakedArrays::default()
//! };
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("hall.lprt");
//! localprt_formats::write(&path, &arrays)?;
//!
//! let baked = Baked::open(&path)?;
//! let checked = baked.checked()?;
//! let cluster = &checked.transport().clusters[0];
//! assert_eq!((cluster.receivers.clone(), cluster.probes), (0..1, &[0][..]));
//! assert_eq!(cluster.projection, block.projection);
//! for section in baked.sections() {
//!     println!("{} {} x {} {}", section.kind, section.count, section.components, section.scalar);
//! }
//! assert!(localprt_formats::check(&path)?.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod baked;
pub mod block;
pub mod check;
mod check_blocks;
pub mod directions;
pub mod error;
pub mod header;
pub mod metadata;
pub mod open;
pub mod quantize;
pub mod section;
pub mod sh;
pub mod transport;
mod verify;
pub mod weight;
pub mod write;

pub use baked::{
    BakedArrays, BakedView, LEVEL_BLACK, LEVEL_SKY, MAX_LEVEL, Metadata, Probe, TransportBytes, VolumeArrays,
    VolumeGrid, VolumeView,
};
pub use block::{
    BlockArrays, BlockRecord, BlockShape, Blocks, ClusterRecord, NEAR_NODES, NEAR_TILE, NearArrays, NearTile,
    TransportBlock, node_at, node_level_and_texel,
};
pub use check::check_invariants;
pub use error::{OpenError, Violation, WriteError};
pub use open::Baked;
pub use section::{Scalar, SectionInfo, SectionKind};
pub use transport::{Block, Checked, Cluster, Tile, Transport};
pub use verify::{check, check_bytes};
pub use write::{to_bytes, write};
