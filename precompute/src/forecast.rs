//! What a bake is going to take, told from a few of its leaves before the others are made; and what there is.

use crate::{
    error::BakeError,
    memory::resident_bytes,
    output::{OutputError, folder_of},
};
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// A forecast is this sure: what is less than this share of it short is tried.
const SURE: f64 = 0.8;

/// What a bake is going to take.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Forecast {
    /// Until all leaves are made, seconds.
    pub seconds: f64,
    /// Largest resident size of the process.
    pub memory_bytes: f64,
    /// Size of the baked file.
    pub file_bytes: f64,
    /// The same with what the bake puts away until it is written.
    pub disk_bytes: f64,
}

/// What a bake may take.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Room {
    /// Memory that the process may have in all; absent: nobody knows.
    pub memory_bytes: Option<u64>,
    /// The baked file, and what is free on its disk.
    pub disk: Option<(PathBuf, u64)>,
}

impl Room {
    /// That of this process for a baked file: memory of the machine or of its control group (cgroup v2), and the free bytes of the disk.
    pub fn for_file(path: PathBuf) -> Self {
        let disk = free_bytes(folder_of(&path));
        Self { memory_bytes: available_memory(), disk: disk.map(|free| (path, free)) }
    }

    /// Refuses a bake that cannot fit.
    ///
    /// # Errors
    /// [`BakeError::Limit`] for memory, [`BakeError::Output`] for the disk.
    pub fn check(&self, forecast: &Forecast) -> Result<(), BakeError> {
        if let Some(allowed) = self.memory_bytes.filter(|&allowed| SURE * forecast.memory_bytes > allowed as f64) {
            return Err(BakeError::Limit {
                what: "the bake".into(),
                needed: format!("about {:.1} GB of memory", forecast.memory_bytes / 1e9),
                allowed: format!("{:.1} GB", allowed as f64 / 1e9),
                remedy: "use fewer --receivers, fewer --threads or a smaller --leaf, or close other programs".into(),
            });
        }
        match &self.disk {
            Some((path, free)) if SURE * forecast.disk_bytes > *free as f64 => {
                let needed = format!("about {:.0} bytes are needed, {free} are free", forecast.disk_bytes);
                Err(OutputError::write(path, io::Error::new(io::ErrorKind::StorageFull, needed)).into())
            }
            _ => Ok(()),
        }
    }
}

/// Memory that this process may have, with what it has.
fn available_memory() -> Option<u64> {
    let of_machine = || -> Option<u64> {
        let text = fs::read_to_string("/proc/meminfo").ok()?;
        let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
        let kib: u64 = line.split_whitespace().next()?.parse().ok()?;
        Some(kib * 1024 + resident_bytes()?)
    };
    let of_group = || -> Option<u64> {
        let text = fs::read_to_string("/proc/self/cgroup").ok()?;
        let group = text.lines().find_map(|line| line.strip_prefix("0::/"))?;
        // A group has no more than those that it is in.
        let groups = Path::new("/sys/fs/cgroup").join(group);
        let most = |folder: &Path| fs::read_to_string(folder.join("memory.max")).ok()?.trim().parse::<u64>().ok();
        groups.ancestors().take_while(|folder| folder.starts_with("/sys/fs/cgroup")).filter_map(most).min()
    };
    [of_machine(), of_group()].into_iter().flatten().min()
}

#[cfg(unix)]
fn free_bytes(folder: &Path) -> Option<u64> {
    let facts = nix::sys::statvfs::statvfs(folder).ok()?;
    Some(facts.blocks_available() as u64 * facts.fragment_size() as u64)
}

#[cfg(not(unix))]
fn free_bytes(_: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::{CommandError, Exit};

    #[test]
    fn what_cannot_fit_is_refused_and_what_may_is_tried() {
        let room = Room { memory_bytes: Some(1_000_000_000), disk: Some(("a.lprt".into(), 1_000_000)) };
        let forecast = Forecast { seconds: 1.0, memory_bytes: 1.1e9, file_bytes: 0.7e6, disk_bytes: 1.1e6 };
        assert!(room.check(&forecast).is_ok());
        let exit = |forecast: Forecast| CommandError::from(room.check(&forecast).expect_err("refused")).exit;
        assert_eq!(exit(Forecast { memory_bytes: 1.4e9, ..forecast }), Exit::Usage);
        assert_eq!(exit(Forecast { disk_bytes: 1.4e6, ..forecast }), Exit::Io);
        assert!(Room::default().check(&Forecast { memory_bytes: 1e30, disk_bytes: 1e30, ..forecast }).is_ok());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_process_knows_its_room() {
        let room = Room::for_file("a.lprt".into());
        assert!(room.memory_bytes.is_some_and(|bytes| bytes > resident_bytes().expect("is told")));
        assert!(room.disk.is_some_and(|(_, free)| free > 0));
    }
}
