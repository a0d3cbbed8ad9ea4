//! Which files of a batch have changed. Files are asked for their times and lengths, twice a second: that sees changes on network
//! drives too, where systems tell nobody, and a list names some hundred files at most.

use super::plan::Plan;
use localprt_precompute::progress::Progress;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, SystemTime};

/// Time between two looks. What has changed has to stay as it is from one to the next: who writes is let finish.
const LOOK: Duration = Duration::from_millis(500);

/// How files were when they were last looked at.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen(BTreeMap<PathBuf, Option<(SystemTime, u64)>>);

impl Seen {
    /// The list and all that its scenes are made from, as they are.
    pub fn of(plan: &Plan) -> Self {
        let files = plan.scenes.iter().flat_map(|job| job.input_files(&plan.root));
        Self(files.chain([plan.list.clone()]).map(|path| (path.clone(), stamp(&path))).collect())
    }

    /// The same files as they are now.
    fn again(&self) -> Self {
        Self(self.0.keys().map(|path| (path.clone(), stamp(path))).collect())
    }

    /// Those that are not as they were.
    fn changed(&self, now: &Self) -> BTreeSet<PathBuf> {
        now.0.iter().filter(|&(path, stamp)| self.0.get(path) != Some(stamp)).map(|(path, _)| path.clone()).collect()
    }

    /// Waits until some have changed, and nothing goes on changing. None if the work is to stop.
    pub fn wait(&self, progress: &Progress) -> BTreeSet<PathBuf> {
        let mut before = self.clone();
        while !progress.is_cancelled() {
            let now = self.again();
            let changed = self.changed(&now);
            if !changed.is_empty() && now == before {
                return changed;
            }
            before = now;
            pause(progress);
        }
        BTreeSet::new()
    }
}

/// Sleeps for one look, or until the work is to stop.
fn pause(progress: &Progress) {
    for _ in 0..10 {
        if !progress.is_cancelled() {
            sleep(LOOK / 10);
        }
    }
}

/// `None` of a file that is not there.
fn stamp(path: &Path) -> Option<(SystemTime, u64)> {
    let data = fs::metadata(path).ok()?;
    Some((data.modified().ok()?, data.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_change_appear_or_go_are_noticed() {
        let folder = tempfile::tempdir().expect("folder");
        let at = |name: &str| folder.path().join(name);
        for name in ["same", "longer", "gone"] {
            fs::write(at(name), "a").expect("written");
        }
        let files = ["same", "longer", "gone", "new"].map(at);
        let seen = Seen(files.iter().map(|path| (path.clone(), stamp(path))).collect());
        assert!(seen.changed(&seen.again()).is_empty());
        fs::write(at("longer"), "ab").expect("written");
        fs::remove_file(at("gone")).expect("removed");
        fs::write(at("new"), "").expect("written");
        assert_eq!(seen.changed(&seen.again()), BTreeSet::from(["longer", "gone", "new"].map(at)));
        assert_eq!(seen.wait(&Progress::silent()).len(), 3);
        let stopped = Progress::silent();
        stopped.cancel();
        assert!(seen.wait(&stopped).is_empty());
    }
}
