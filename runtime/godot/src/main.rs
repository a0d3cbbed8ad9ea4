//! What the add-on for Godot cannot make itself: its shaders as SPIR-V, and the surfaces of a baked scene.

mod shaders;
mod surfaces;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const USAGE: &str = "\
Usage: localprt-godot surfaces FILE.lprt [--scene SCENE.glb] [-o OUT]
       localprt-godot shaders FOLDER

surfaces   the surfaces of a baked scene, for the add-on: FILE.surfaces beside FILE.lprt, or OUT
shaders    the add-on's shaders as SPIR-V, one file each";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("localprt-godot: {error}");
            let mut cause = error.source();
            while let Some(error) = cause {
                eprintln!("  because {error}");
                cause = error.source();
            }
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["shaders", folder] => shaders::write(Path::new(folder)),
        ["surfaces", file, ref options @ ..] => write_surfaces(Path::new(file), options),
        ["--help" | "-h"] => {
            println!("{USAGE}");
            Ok(())
        }
        _ => Err(USAGE.into()),
    }
}

fn write_surfaces(file: &Path, options: &[&str]) -> Result<(), Box<dyn Error>> {
    let (mut scene, mut out) = (None, file.with_extension("surfaces"));
    for option in options.chunks(2) {
        match option {
            ["--scene", path] => scene = Some(PathBuf::from(path)),
            ["-o", path] => out = PathBuf::from(path),
            _ => return Err(USAGE.into()),
        }
    }
    surfaces::write(file, scene.as_deref(), &out)
}
