//! How different two pictures look: `cargo run --release -p localprt-precompute --example flip -- A.png B.png`

use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8, flip};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let [test, reference] = paths.as_slice() else { return Err("usage: flip A.png B.png".into()) };
    let read = |path: &String| Ok::<_, Box<dyn Error>>(image::open(path)?.to_rgb8());
    let (test, reference) = (read(test)?, read(reference)?);
    if test.dimensions() != reference.dimensions() {
        return Err(format!("sizes differ: {:?} and {:?}", test.dimensions(), reference.dimensions()).into());
    }
    let flip_image = |picture: &image::RgbImage| FlipImageRgb8::with_data(picture.width(), picture.height(), picture);
    let values = flip(flip_image(&reference), flip_image(&test), DEFAULT_PIXELS_PER_DEGREE).to_vec();
    let mean = values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len().max(1) as f64;
    println!("FLIP mean {mean:.4}, max {:.4}", values.iter().copied().fold(0.0, f32::max));
    Ok(())
}
