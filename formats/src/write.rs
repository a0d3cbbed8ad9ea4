//! Writing a file: invariants first, then a temporary neighbor, sync, rename. The same arrays give the same bytes.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::baked::{BakedArrays, BakedView};
use crate::check::check_invariants;
use crate::error::WriteError;
use crate::header::{self, ENTRY_BYTES, HEADER_BYTES, Known, LAYOUTS};
use crate::metadata;
use crate::section::SectionInfo;

/// Writes `arrays` to `path`, whole or not at all.
///
/// The bytes go to a temporary file in the same folder, which is synced and then renamed to `path`; then the folder is
/// synced. On any failure a file that was there before is unharmed.
///
/// # Errors
/// [`WriteError::Invalid`] if the arrays break an invariant, [`WriteError::NotAFile`] if `path` is a folder or device,
/// [`WriteError::Io`] with the bytes needed if the file system refuses, and the two about metadata.
pub fn write(path: impl AsRef<Path>, arrays: &BakedArrays) -> Result<(), WriteError> {
    let path = path.as_ref();
    if fs::metadata(path).is_ok_and(|found| !found.is_file()) {
        return Err(WriteError::NotAFile { path: path.into() });
    }
    let view = arrays.view();
    let plan = Plan::new(&view)?;
    let failed = |action| {
        let path = PathBuf::from(path);
        let needed_bytes = plan.file_bytes;
        move |source| WriteError::Io { action, path, needed_bytes, source }
    };
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut temporary = temporary_in(folder).map_err(failed("create a temporary file beside"))?;
    plan.write_to(temporary.as_file_mut()).map_err(failed("write"))?;
    temporary.as_file().sync_all().map_err(failed("sync"))?;
    temporary.persist(path).map_err(|error| failed("rename a temporary file to")(error.error))?;
    sync_folder(folder).map_err(failed("sync the folder of"))
}

/// The bytes that [`write()`] would write.
///
/// # Errors
/// As [`write()`], without those of the file system.
pub fn to_bytes(arrays: &BakedArrays) -> Result<Vec<u8>, WriteError> {
    let view = arrays.view();
    let plan = Plan::new(&view)?;
    let mut bytes = Vec::with_capacity(plan.file_bytes as usize);
    plan.write_to(&mut bytes).map_err(|source| WriteError::Io {
        action: "collect",
        path: PathBuf::new(),
        needed_bytes: plan.file_bytes,
        source,
    })?;
    Ok(bytes)
}

/// Everything about a file but the payloads, which stay where they are.
struct Plan<'a> {
    head: Vec<u8>,
    metadata: Vec<u8>,
    view: &'a BakedView<'a>,
    sections: Vec<(Known, SectionInfo)>,
    file_bytes: u64,
}

impl<'a> Plan<'a> {
    fn new(view: &'a BakedView<'a>) -> Result<Self, WriteError> {
        check_invariants(view)?;
        let metadata = metadata::encode(view.metadata)?;
        let present: Vec<_> = LAYOUTS
            .iter()
            .filter_map(|layout| payload(layout.known, view, &metadata).map(|payload| (layout.known, payload)))
            .collect();
        let mut hasher = blake3::Hasher::new();
        let mut end = (HEADER_BYTES + present.len() * ENTRY_BYTES) as u64;
        let mut sections = Vec::with_capacity(present.len());
        for (known, payload) in present {
            hasher.update(payload);
            let layout = &LAYOUTS[known as usize];
            let length = payload.len() as u64;
            // The payloads are in memory, so no sum of their lengths comes near 2^64.
            let offset = end.next_multiple_of(header::ALIGNMENT);
            end = offset + length;
            let info = SectionInfo {
                kind: layout.kind,
                version: layout.version,
                required: layout.required,
                scalar: layout.scalar,
                components: layout.components,
                count: length / (layout.scalar.bytes() * u64::from(layout.components)),
                offset,
                length,
                checksum: crc32c::crc32c(payload),
            };
            sections.push((known, info));
        }
        let infos: Vec<_> = sections.iter().map(|(_, info)| *info).collect();
        let head = header::encode(&infos, end, |table| *hasher.update(table).finalize().as_bytes());
        Ok(Self { head, metadata, view, sections, file_bytes: end })
    }

    fn write_to(&self, out: &mut impl Write) -> io::Result<()> {
        out.write_all(&self.head)?;
        let mut end = self.head.len() as u64;
        for (known, info) in &self.sections {
            let padding = [0; header::ALIGNMENT as usize];
            out.write_all(&padding[..(info.offset - end) as usize])?;
            out.write_all(payload(*known, self.view, &self.metadata).unwrap_or_default())?;
            end = info.offset + info.length;
        }
        Ok(())
    }
}

/// A section's bytes; `None` for an optional one that is left out.
fn payload<'a>(known: Known, view: &BakedView<'a>, metadata: &'a [u8]) -> Option<&'a [u8]> {
    use bytemuck::cast_slice;
    Some(match known {
        Known::Metadata => metadata,
        Known::Probes => cast_slice(view.probes),
        Known::RayDirs => cast_slice(view.ray_dirs),
        Known::RaySh => cast_slice(view.ray_sh),
        Known::RayUv => cast_slice(view.ray_uv),
        Known::RayLevel => view.ray_level,
        Known::RayDistance if view.ray_distance.is_empty() => return None,
        Known::RayDistance => cast_slice(view.ray_distance),
        Known::ReceiverTexel => cast_slice(view.receiver_texel),
        Known::ReceiverPosition => cast_slice(view.receiver_position),
        Known::ReceiverNormal => cast_slice(view.receiver_normal),
        Known::ReceiverUnseen => cast_slice(view.receiver_unseen),
        Known::Blocks => cast_slice(view.blocks.records),
        Known::BlockData => cast_slice(view.blocks.data),
        Known::Gutters => cast_slice(view.gutters),
        Known::Seams => cast_slice(view.seams),
        Known::Volume => bytemuck::bytes_of(view.volume?.grid),
        Known::VolumeCells => cast_slice(view.volume?.cells),
        Known::VolumeBlocks => cast_slice(view.volume?.blocks.records),
        Known::VolumeBlockData => cast_slice(view.volume?.blocks.data),
        Known::VolumeFill => cast_slice(view.volume?.fill),
        Known::Report if view.report.is_empty() => return None,
        Known::Report => view.report.as_bytes(),
        Known::Plan if view.plan.is_empty() => return None,
        Known::Plan => view.plan.as_bytes(),
    })
}

fn temporary_in(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".lprt-").suffix(".tmp");
    // A temporary file is private by default; the finished one has the permissions of any new file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// Makes the rename durable. Some file systems cannot sync a folder and say so; the file is in place all the same.
fn sync_folder(folder: &Path) -> io::Result<()> {
    if !cfg!(unix) {
        return Ok(());
    }
    match File::open(folder).and_then(|opened| opened.sync_all()) {
        Err(error) if !matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => Err(error),
        _ => Ok(()),
    }
}
