//! `precompute cache`: what a place of kept results holds; and which one a bake uses.

use super::{grouped, print_data, size, to_json};
use crate::cli::{CacheCommand, CacheFlags};
use localprt_precompute::cache::{Cache, CacheOptions, PlaceError};
use localprt_precompute::error::{CommandError, Exit};
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
    let about_place = |what: String| CommandError::new(Exit::Io, what).in_file(Path::new(&place.to_string()));
    if !Cache::is_at(place)? {
        let kind = if place.is_folder() { "folder" } else { "bucket and folder" };
        return Err(about_place("there is no cache".into()).help(format!("name the {kind} that bakes keep results in")));
    }
    let is_changed = command.trim.is_some() || command.verify;
    let cache = Cache::open_place(place, CacheOptions { read_only: !is_changed, ..CacheOptions::default() })?;
    let damaged = command.verify.then(|| cache.verify());
    let trimmed_bytes = command.trim.map_or(0, |bytes| cache.trim(bytes));
    let left = cache.facts();
    if let Some(cause) = cache.failure() {
        let help = "check the server, and what its credentials allow: listing, reading, removing";
        return Err(about_place(format!("not all results could be read: {cause}")).help(help));
    }
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
/// [`PlaceError`] if the place that was named cannot be used. Where nobody named one, the bake goes on without.
pub fn of_bake(flags: &CacheFlags, output: &Path, progress: &Progress) -> Result<Option<Cache>, PlaceError> {
    if flags.no_cache {
        return Ok(None);
    }
    // Without a limit from here a bucket is nobody's to trim: it belongs to many, and has rules of its own.
    let is_bucket = flags.cache.as_ref().is_some_and(|place| !place.is_folder());
    let usual = if is_bucket { u64::MAX } else { CacheOptions::default().limit_bytes };
    let limit_bytes = flags.cache_limit.unwrap_or(usual);
    let options = CacheOptions { read_only: flags.cache_read, limit_bytes, explain: flags.explain };
    match &flags.cache {
        Some(place) => Cache::open_place(place, options).map(Some),
        None => match Cache::open(&output.with_file_name(FOLDER), options) {
            Ok(cache) => Ok(Some(cache)),
            Err(error) => {
                progress.note(&format!("nothing is kept for the next bake: {error}"));
                Ok(None)
            }
        },
    }
}
