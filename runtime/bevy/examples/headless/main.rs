//! Draws a baked scene with Bevy, off screen:
//!
//!     headless FILE.lprt pictures OUT    OUT/NAME.png, and OUT/NAME.json, the same light for the viewer
//!     headless FILE.lprt ball OUT        OUT/ball.png, a ball in the light of the volume, held against the relighter on the CPU
//!     headless FILE.lprt use             takes the scene away and spawns it anew; a scene that is another one
//!     headless FILE.lprt frames N        N frames with a moving lamp and a changing emission, and what memory they leave behind
//!
//! FILE.lprt is a bake of the Cornell box of this project. Exit code 1 if something is not as it should be.

mod ball;
mod memory;
mod pictures;
mod stage;

use stage::Stage;
use std::path::Path;
use std::process::ExitCode;

/// Pixels of pictures, and of frames that are only counted.
const PICTURE: [u32; 2] = [480, 360];
const SMALL: [u32; 2] = [96, 72];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let done = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [file, "pictures", out] => {
            Stage::new(Path::new(file), PICTURE).and_then(|stage| pictures::pictures(stage, Path::new(out)))
        }
        [file, "ball", out] => {
            Stage::new(Path::new(file), PICTURE).and_then(|stage| ball::ball(stage, Path::new(file), Path::new(out)))
        }
        [file, "use"] => Stage::new(Path::new(file), PICTURE).and_then(|stage| memory::used(stage, Path::new(file))),
        [file, "frames", n_frames] => match n_frames.parse() {
            Ok(n_frames) => Stage::new(Path::new(file), SMALL).and_then(|stage| memory::frames(stage, n_frames)),
            Err(_) => Err(format!("{n_frames} is no number of frames")),
        },
        _ => Err("headless FILE.lprt pictures OUT | ball OUT | use | frames N".to_owned()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("headless: {why}");
            ExitCode::FAILURE
        }
    }
}
