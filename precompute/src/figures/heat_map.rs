//! Heat maps: one color per number, with the title above and the printed scale below.

use super::axis::{Axis, number};
use super::canvas::{self, Align, Canvas, INK, MUTED, PAPER};
use super::{Ramp, Rgb8Image};

/// Numbers on a grid, to be drawn as colors.
#[derive(Clone, Copy, Debug)]
pub struct HeatMap<'a> {
    /// Values per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `[height][width]`, top row first; NaN, and what is missing at the end, has no value.
    pub values: &'a [f32],
    /// Color where there is no value.
    pub background: [u8; 3],
    /// Above the map.
    pub title: &'a str,
    /// What the numbers are and their unit, beside the scale.
    pub unit: &'a str,
    /// Colors of the numbers.
    pub ramp: Ramp,
    /// Numbers at the two ends of the ramp; those beyond have the color of the end, and the scale says so.
    pub range: [f32; 2],
}

/// Narrowest picture, in pixels: less holds no scale.
const NARROWEST: u32 = 420;

// Sizes in pixels for a picture up to `LEGIBLE` wide; larger ones are shown reduced, so that their texts grow with them.
const LEGIBLE: f32 = 640.0;
const TITLE_ROWS: i32 = 36;
const SCALE_ROWS: i32 = 68;
const MARGIN: i32 = 14;
const TITLE: i32 = 19;
const TEXT: i32 = 16;

impl HeatMap<'_> {
    /// The picture. Small maps are magnified by a whole number and centered, see [`HeatMap::place`].
    pub fn draw(&self) -> Rgb8Image {
        let frame = Frame::new(self.width, self.height, self.title);
        let mut image = frame.picture(self.title, |index| match self.value(index) {
            Some(value) => self.ramp.color(self.position(value)),
            None => self.background,
        });
        let scale = canvas::image(image.width, frame.px(SCALE_ROWS) as u32, |canvas| self.draw_scale(canvas, &frame));
        append(&mut image, &scale);
        image
    }

    /// Where the picture shows a value: column and row of the first pixel, and pixels per side.
    pub fn place(&self, column: u32, row: u32) -> [u32; 3] {
        let frame = Frame::new(self.width, self.height, self.title);
        [frame.left + column * frame.zoom, frame.top + row * frame.zoom, frame.zoom]
    }

    fn value(&self, index: usize) -> Option<f32> {
        self.values.get(index).copied().filter(|value| !value.is_nan())
    }

    /// Place on the ramp; a range without length has everything at its start or its end.
    fn position(&self, value: f32) -> f32 {
        let [low, high] = self.range;
        if high > low { (value - low) / (high - low) } else { f32::from(value > high) }
    }

    fn draw_scale(&self, canvas: &dyn Canvas, frame: &Frame) {
        let px = |size| frame.px(size);
        let [width, _] = canvas.size();
        let count = self.width as usize * self.height as usize;
        let values = || (0..count).filter_map(|index| self.value(index));
        let above = values().any(|value| value > self.range[1]);
        let below = values().any(|value| value < self.range[0]);
        let (top, bottom, middle) = (px(8), px(24), px(16));

        // What an empty pixel looks like is at the right of the bar.
        let mut right = width - px(MARGIN);
        if values().count() < count {
            let text = "no value";
            right -= canvas::text_width(text, px(TEXT));
            canvas.text(text, [right, middle], px(TEXT), INK, Align::Left);
            let side = bottom - top;
            right -= side + px(6);
            canvas.rect([right, top], [right + side, bottom], MUTED);
            canvas.rect([right + 1, top + 1], [right + side - 1, bottom - 1], self.background);
            right -= px(18);
        }
        let (left, right) = (px(MARGIN + 10), right - px(10));
        for x in left..right {
            let t = (x - left) as f32 / (right - 1 - left).max(1) as f32;
            canvas.rect([x, top], [x + 1, bottom], self.ramp.color(t));
        }
        // An arrow in the color of the end: there is more beyond it.
        if above {
            canvas.polygon(&[[right + 2, top], [right + px(10), middle], [right + 2, bottom]], self.ramp.color(1.0));
        }
        if below {
            canvas.polygon(&[[left - 2, top], [left - px(10), middle], [left - 2, bottom]], self.ramp.color(0.0));
        }

        let [low, high] = self.range.map(f64::from);
        let axis = Axis { low, high, log: false };
        let holds = high > low && Axis::holds(false, low) && Axis::holds(false, high);
        let ticks = if holds { axis.ticks(5) } else { Vec::new() };
        for &tick in &ticks {
            let x = left + (axis.position(tick) * f64::from(right - 1 - left)).round() as i32;
            canvas.rect([x, bottom], [x + 1, bottom + px(4)], MUTED);
            canvas.text(&axis.label(tick), [x, px(37)], px(TEXT), INK, Align::Middle);
        }
        let step = if high > low { (high - low) / 100.0 } else { 0.01 };
        let note = match (below, above) {
            (false, false) => String::new(),
            (false, true) => format!("clipped above {}", number(high, step)),
            (true, false) => format!("clipped below {}", number(low, step)),
            (true, true) => format!("clipped below {} and above {}", number(low, step), number(high, step)),
        };
        canvas.text(&note, [width - px(MARGIN), px(56)], px(TEXT), MUTED, Align::Right);
        let room = width - px(3 * MARGIN) - canvas::text_width(&note, px(TEXT));
        let unit = canvas::fitted(self.unit, px(TEXT), room);
        canvas.text(&unit, [px(MARGIN), px(56)], px(TEXT), MUTED, Align::Left);
    }
}

/// A map of colors that stand for no numbers, such as one color per group, with a title above and a note below.
///
/// `colors` is `[height][width]`, top row first; what is missing at the end is white. Small maps are magnified as
/// [`HeatMap::draw`] does.
pub fn draw_labels(width: u32, height: u32, colors: &[[u8; 3]], title: &str, note: &str) -> Rgb8Image {
    let frame = Frame::new(width, height, title);
    let mut image = frame.picture(title, |index| colors.get(index).copied().unwrap_or(PAPER));
    let lines = wrapped(note, frame.px(TEXT), image.width as i32 - 2 * frame.px(MARGIN));
    if !lines.is_empty() {
        let line_height = frame.px(20);
        let rows = lines.len() as i32 * line_height + frame.px(12);
        let strip = canvas::image(image.width, rows as u32, |canvas| {
            for (line, index) in lines.iter().zip(0..) {
                let at = [frame.px(MARGIN), frame.px(16) + index * line_height];
                canvas.text(line, at, frame.px(TEXT), MUTED, Align::Left);
            }
        });
        append(&mut image, &strip);
    }
    image
}

/// Where a map lies in its picture.
struct Frame {
    map: [u32; 2],
    zoom: u32,
    left: u32,
    top: u32,
    image_width: u32,
}

impl Frame {
    fn new(width: u32, height: u32, title: &str) -> Self {
        let zoom = (NARROWEST / width.max(height).max(1)).max(1);
        let image_width = (width * zoom).max(NARROWEST);
        let mut frame =
            Self { map: [width, height], zoom, left: (image_width - width * zoom) / 2, top: 0, image_width };
        if !title.is_empty() {
            frame.top = frame.px(TITLE_ROWS) as u32;
        }
        frame
    }

    /// A size of texts and strips, grown for a large picture.
    fn px(&self, size: i32) -> i32 {
        (size as f32 * (self.image_width as f32 / LEGIBLE).max(1.0)).round() as i32
    }

    /// The title and below it the map, with a color for each of its indices; at least one row.
    fn picture(&self, title: &str, color: impl Fn(usize) -> [u8; 3]) -> Rgb8Image {
        let size = self.px(TITLE);
        let mut image = canvas::image(self.image_width, self.top, |canvas| {
            let title = canvas::fitted(title, size, canvas.size()[0] - 2 * self.px(MARGIN));
            canvas.text(&title, [self.px(MARGIN), self.top as i32 / 2], size, INK, Align::Left);
        });
        let [width, height] = self.map;
        let rows = (height * self.zoom).max(u32::from(self.top == 0));
        append(&mut image, &Rgb8Image::filled(self.image_width, rows, PAPER));
        for (index, (y, x)) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))).enumerate() {
            let color = color(index);
            for pixel in 0..self.zoom * self.zoom {
                let [dx, dy] = [pixel % self.zoom, pixel / self.zoom];
                image.set(self.left + x * self.zoom + dx, self.top + y * self.zoom + dy, color);
            }
        }
        image
    }
}

/// Adds rows of the same width at the bottom.
fn append(image: &mut Rgb8Image, below: &Rgb8Image) {
    assert_eq!(image.width, below.width, "strips of a picture are as wide as it is");
    image.height += below.height;
    image.pixels.extend_from_slice(&below.pixels);
}

/// Lines of a text that fit a width, broken at spaces; longer words are cut.
fn wrapped(text: &str, size: i32, width: i32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if canvas::text_width(&format!("{line} {word}"), size) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(canvas::fitted(word, size, width)),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    const PINK: [u8; 3] = [255, 0, 200];

    fn map(width: u32, height: u32, values: &[f32]) -> HeatMap<'_> {
        HeatMap {
            width,
            height,
            values,
            background: PINK,
            title: "Error",
            unit: "W m^-2",
            ramp: Ramp::Sequential,
            range: [0.0, 2.0],
        }
    }

    #[test]
    fn values_are_drawn_in_their_place_and_color() {
        let values = [0.0, 1.0, f32::NAN, 9.0, 0.5, 2.0];
        let map = map(3, 2, &values);
        let image = map.draw();
        let expected = [0.0, 0.5, f32::NAN, 1.0, 0.25, 1.0];
        for (index, t) in expected.into_iter().enumerate() {
            let [x, y, side] = map.place(index as u32 % 3, index as u32 / 3);
            let color = if t.is_nan() { PINK } else { Ramp::Sequential.color(t) };
            let corners = [image.pixel(x, y), image.pixel(x + side - 1, y + side - 1)];
            assert_eq!(corners, [color; 2], "value {index}");
        }
        assert_eq!(image.pixels.len(), 3 * (image.width * image.height) as usize);
    }

    #[test]
    fn large_maps_are_not_scaled() {
        let values: Vec<f32> = (0..500 * 300).map(|index| (index % 500) as f32 / 250.0).collect();
        let map = map(500, 300, &values);
        let image = map.draw();
        assert_eq!((image.width, map.place(7, 9)), (500, [7, 9 + TITLE_ROWS as u32, 1]));
        assert_eq!(image.pixel(250, 100), Ramp::Sequential.color(1.0 / 2.0));
    }

    #[test]
    fn the_scale_is_printed_and_says_what_is_clipped() {
        let strip = |values: &[f32]| {
            let image = map(2, 1, values).draw();
            image.pixels[3 * ((image.height - SCALE_ROWS as u32) * image.width) as usize..].to_vec()
        };
        let shown = strip(&[1.0, 2.0]);
        // The bar and its ticks end 28 rows down; below there is nothing but text.
        let text = &shown[3 * 29 * NARROWEST as usize..];
        assert!(text.iter().filter(|&&value| value < 160).count() > 300, "numbers and unit are dark");
        assert_ne!(shown, strip(&[1.0, 2.5]), "clipped above");
        assert_ne!(shown, strip(&[1.0, -1.0]), "clipped below");
        assert_ne!(shown, strip(&[1.0, f32::NAN]), "no value");
        assert_eq!(shown, strip(&[0.0, 0.5]));
    }

    #[test]
    fn notes_stand_below_label_colors() {
        let image = draw_labels(2, 1, &[PINK, [0, 0, 255]], "Groups", &"many words ".repeat(20));
        assert_eq!((image.pixel(5, 40), image.pixel(400, 40)), (PINK, [0, 0, 255]));
        let bare = draw_labels(2, 1, &[PINK], "Groups", "");
        assert!(image.height > bare.height + 40);
        let below = &image.pixels[3 * (bare.height * image.width) as usize..];
        assert!(below.iter().any(|&value| value < 150), "text is dark");
    }

    #[test]
    fn odd_maps_are_drawn_without_a_panic() {
        let odd = [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MAX];
        for range in [[0.0, 0.0], [1.0, -1.0], [f32::NAN, 1.0], [f32::MIN, f32::MAX], [0.0, f32::INFINITY]] {
            for (width, height) in [(0, 0), (1, 1), (4, 1), (1, 900)] {
                let title = &"long ".repeat(100);
                HeatMap { range, title, unit: title, ..map(width, height, &odd) }.draw();
            }
        }
        assert_eq!(draw_labels(0, 0, &[], "", "").height, 1);
    }
}
