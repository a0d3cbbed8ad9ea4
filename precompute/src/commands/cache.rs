//! `precompute cache`: what a folder of kept results holds; and which one a bake uses.

use super::{grouped, print_data, size, to_json};
use crate::cli::{CacheCommand, CacheFlags};
use localprt_precompute::cache::{Cache, CacheOptions};
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::output::OutputError;
use localprt_precompute::progress::Progress;
use serde::Serialize;
use std::path::Path;

/// Beside the baked file, unless another place is named.
const FOLDER: &str = ".localprt-cache";

/// What `cache --json` prints.
#[derive(Serialize)]
struct Facts {
    records: u64,
    bytes: u64,
    trimmed_bytes: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    damaged: Option<u64>,
}

/// Runs the subcommand.
pub fn run(command: &CacheCommand) -> Result<(), CommandError> {
    let place = &command.place;
    if !Cache::is_one(place) {
        let what = "there is no cache";
        return Err(CommandError::new(Exit::Io, what)
            .in_file(place)
            .help("name the folder that bakes keep results in"));
    }
    let is_changed = command.trim.is_some() || command.verify;
    let cache = Cache::open(place, CacheOptions { read_only: !is_changed, ..CacheOptions::default() })?;
    let damaged = command.verify.then(|| cache.verify());
    let trimmed_bytes = command.trim.map_or(0, |bytes| cache.trim(bytes));
    let left = cache.facts();
    let facts = Facts { records: left.records, bytes: left.bytes, trimmed_bytes, damaged };
    print_data(&if command.json { to_json(&facts) } else { facts.to_text() })
}

impl Facts {
    fn to_text(&self) -> String {
        let mut text = format!("{} results, {}\n", grouped(self.records), size(self.bytes));
        if let Some(damaged) = self.damaged {
            text += &format!("{} damaged ones removed\n", grouped(damaged));
        }
        if self.trimmed_bytes > 0 {
            text += &format!("{} of those used longest ago removed\n", size(self.trimmed_bytes));
        }
        text
    }
}

/// The cache that a bake into `output` uses; `None` if it uses none.
///
/// # Errors
/// [`OutputError`] if the place that was named cannot be used. Where nobody named one, the bake goes on without.
pub fn of_bake(flags: &CacheFlags, output: &Path, progress: &Progress) -> Result<Option<Cache>, OutputError> {
    if flags.no_cache {
        return Ok(None);
    }
    let options = CacheOptions { read_only: flags.cache_read, limit_bytes: flags.cache_limit, explain: flags.explain };
    match &flags.cache {
        Some(place) => Cache::open(place, options).map(Some),
        None => match Cache::open(&output.with_file_name(FOLDER), options) {
            Ok(cache) => Ok(Some(cache)),
            Err(error) => {
                progress.note(&format!("nothing is kept for the next bake: {error}"));
                Ok(None)
            }
        },
    }
}
