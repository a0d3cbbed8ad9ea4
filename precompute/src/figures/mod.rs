//! Figures: heat maps, charts and the page that shows them. Knows numbers, names and pictures, and nothing about light.
//!
//! [`HeatMap`] turns an array of numbers into a picture with a printed scale, [`Chart`] and [`BarChart`] draw the same
//! figure as SVG or as pixels, and [`Page`] puts all of them on one HTML page that opens from disk without a network.
//! Writing files is left to [`crate::output`].

mod axis;
mod bars;
mod canvas;
mod chart;
mod heat_map;
mod page;
mod page_blocks;

pub use bars::BarChart;
pub use chart::{Chart, Series};
pub use heat_map::{HeatMap, draw_labels};
pub use localprt_tools::{
    ramp::Ramp,
    range::{nice_range, nice_signed_range},
};
pub use page::{Block, NamedImage, Number, Page, Section, Verdict};

/// A picture of 8-bit sRGB pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb8Image {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `[height][width][3]`, top row first.
    pub pixels: Vec<u8>,
}

impl Rgb8Image {
    /// A picture of one color.
    pub(crate) fn filled(width: u32, height: u32, color: [u8; 3]) -> Self {
        Self { width, height, pixels: color.repeat(width as usize * height as usize) }
    }

    /// The color at a column and row, both counted from the top left and inside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 3] {
        let at = self.index(x, y);
        [self.pixels[at], self.pixels[at + 1], self.pixels[at + 2]]
    }

    /// Colors one pixel.
    pub(crate) fn set(&mut self, x: u32, y: u32, color: [u8; 3]) {
        let at = self.index(x, y);
        self.pixels[at..at + 3].copy_from_slice(&color);
    }

    fn index(&self, x: u32, y: u32) -> usize {
        3 * (y as usize * self.width as usize + x as usize)
    }
}
