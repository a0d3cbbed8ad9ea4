//! Whole bakes that a cache knows: what was written, and the report of it. A bake whose files are still what it would write has
//! nothing to do.

use super::{Written, leaf_cache::code};
use crate::{
    cache::{Cache, Packer, Unpacker},
    digest::{Digest, Digester},
    report::{BakeReport, CacheUse},
    settings::BakeSettings,
};
use localprt_scenes::Scene;
use std::{fs::File, path::Path};

/// Records of bakes.
const BAKE: &str = "bake";

/// A cache with the place of one bake: of a scene, as it was read from a file, by some options into files of some names.
pub struct KeptBake<'a> {
    cache: &'a Cache,
    digest: Digest,
    output: &'a Path,
    scene: &'a Path,
}

impl<'a> KeptBake<'a> {
    /// `output` is the baked file, and `scene` where the scene goes, if it is written; `source` is where it was read from. `layout`
    /// tells which layout is kept: the same text, the same layout.
    pub fn of(
        cache: &'a Cache,
        read: &Scene,
        settings: &BakeSettings,
        [output, scene]: [&'a Path; 2],
        source: &str,
        layout: &str,
    ) -> Self {
        let mut digester = Digester::new("bake");
        code(&mut digester);
        digester.one(read.hash).all(settings.to_toml().as_bytes()).all(source.as_bytes());
        digester.all(layout.as_bytes());
        for path in [output, scene] {
            digester.all(path.as_os_str().as_encoded_bytes());
        }
        Self { cache, digest: digester.finish(), output, scene }
    }

    /// The report of the bake, if its files are there and as it wrote them.
    pub fn find(&self) -> Option<BakeReport> {
        let (files, report) = unpack(&self.cache.get(BAKE, &self.digest)?)?;
        let found = [self.output, self.scene].into_iter().zip(&files);
        let is_there = found.into_iter().all(|(path, digest)| digest_of_file(path).as_ref() == Some(digest));
        is_there.then_some(report)
    }

    /// Keeps what was written.
    pub fn keep(&self, written: &Written) {
        // Another bake into the same file may have been faster.
        let is_own = |baked: localprt_formats::Baked| baked.view().metadata.options == written.report.options.to_toml();
        if !localprt_formats::Baked::open(self.output).is_ok_and(is_own) {
            return;
        }
        let files = [Some(self.output), Some(self.scene).filter(|_| written.is_scene_new)].into_iter().flatten();
        let Some(files) = files.map(digest_of_file).collect::<Option<Vec<Digest>>>() else { return };
        let mut packer = Packer::default();
        packer.put(&files).put(written.report.to_json().as_bytes());
        self.cache.replace(BAKE, &self.digest, &packer.finish());
    }
}

/// Digests of the files, and the report as it is of a bake that finds all leaves.
pub(super) fn unpack(record: &[u8]) -> Option<(Vec<Digest>, BakeReport)> {
    let mut record = Unpacker::new(record);
    let (files, report): (Vec<Digest>, Vec<u8>) = (record.take()?, record.take()?);
    let report: BakeReport = serde_json::from_slice(&report).ok()?;
    let of_cache = |leaves: CacheUse| CacheUse { reused: leaves.reused.saturating_add(leaves.baked), baked: 0 };
    // The baked file, and the scene if it was written.
    let is_whole = record.is_done() && (1..=2).contains(&files.len());
    is_whole.then(|| (files, BakeReport { cache: report.cache.map(of_cache), ..report }))
}

fn digest_of_file(path: &Path) -> Option<Digest> {
    let mut digest = blake3::Hasher::new();
    digest.update_reader(File::open(path).ok()?).ok()?;
    Some(*digest.finalize().as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_names_files_and_counts_what_fits() {
        let report = |reused, baked| BakeReport { cache: Some(CacheUse { reused, baked }), ..BakeReport::default() };
        let read = |n_files: usize, report: &BakeReport| {
            let mut packer = Packer::default();
            packer.put(&vec![[7u8; 32]; n_files]).put(report.to_json().as_bytes());
            unpack(&packer.finish()).map(|(files, report)| (files.len(), report.cache.expect("is kept").reused))
        };
        assert_eq!((read(1, &report(3, 4)), read(2, &report(0, 9))), (Some((1, 7)), Some((2, 9))));
        // Of no file, nothing would be asked; and no sum of counts is too large.
        assert_eq!((read(0, &report(3, 4)), read(3, &report(3, 4))), (None, None));
        assert_eq!(read(1, &report(u64::MAX, 4)), Some((1, u64::MAX)));
    }
}
