//! Writes the seeds of all targets: `seeds FOLDER`, a folder for each.

// What is instrumented for libFuzzer is linked with it.
#[cfg(feature = "libfuzzer")]
use libfuzzer_sys as _;
use std::{error::Error, fs, path::PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("usage: seeds FOLDER")?);
    for target in localprt_fuzz::targets() {
        let folder = folder.join(target.name);
        fs::create_dir_all(&folder)?;
        for (number, seed) in target.seeds.iter().enumerate() {
            fs::write(folder.join(format!("seed-{number}")), seed)?;
        }
    }
    Ok(())
}
