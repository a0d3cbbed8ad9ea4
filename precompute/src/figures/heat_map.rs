//! Heat maps: one color per number, with the title above and the printed scale below.

use super::axis::{Axis, number, round_up};
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
/// Rows above the map, if there is a title.
const TITLE_ROWS: u32 = 36;
/// Rows of the scale.
const SCALE_ROWS: u32 = 64;
/// Distance of texts and scale from the sides.
const MARGIN: i32 = 14;
const TEXT: i32 = 15;

impl HeatMap<'_> {
    /// The picture. Small maps are magnified by a whole number and centered, see [`HeatMap::place`].
    pub fn draw(&self) -> Rgb8Image {
        let frame = Frame::new(self.width, self.height, self.title, SCALE_ROWS);
        let mut image = frame.picture(self.title, |index| match self.value(index) {
            Some(value) => self.ramp.color(self.position(value)),
            None => self.background,
        });
        let top = frame.below() as i32;
        canvas::paint(&mut image, |canvas| self.draw_scale(canvas, top));
        image
    }

    /// Where the picture shows a value: column and row of the first pixel, and pixels per side.
    pub fn place(&self, column: u32, row: u32) -> [u32; 3] {
        let frame = Frame::new(self.width, self.height, self.title, SCALE_ROWS);
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

    fn draw_scale(&self, canvas: &dyn Canvas, top: i32) {
        let [width, _] = canvas.size();
        let count = self.width as usize * self.height as usize;
        let values = || (0..count).filter_map(|index| self.value(index));
        let above = values().any(|value| value > self.range[1]);
        let below = values().any(|value| value < self.range[0]);
        let empty = values().count() < count;

        // From the right: what an empty pixel looks like; the bar; its unit on a line of its own.
        let mut right = width - MARGIN;
        if empty {
            let text = "no value";
            right -= canvas::text_width(text, TEXT);
            canvas.text(text, [right, top + 15], TEXT, MUTED, Align::Left);
            canvas.rect([right - 22, top + 8], [right - 6, top + 22], MUTED);
            canvas.rect([right - 21, top + 9], [right - 7, top + 21], self.background);
            right -= 40;
        }
        let (left, right) = (MARGIN + 10, right - 10);
        for x in left..right {
            let t = (x - left) as f32 / (right - 1 - left).max(1) as f32;
            canvas.rect([x, top + 8], [x + 1, top + 22], self.ramp.color(t));
        }
        // An arrow in the color of the end: there is more beyond it.
        if above {
            let points = [[right + 1, top + 8], [right + 10, top + 15], [right + 1, top + 21]];
            canvas.polygon(&points, self.ramp.color(1.0));
        }
        if below {
            let points = [[left - 2, top + 8], [left - 11, top + 15], [left - 2, top + 21]];
            canvas.polygon(&points, self.ramp.color(0.0));
        }

        let [low, high] = self.range.map(f64::from);
        let axis = Axis { low, high, log: false };
        let holds = high > low && Axis::holds(false, low) && Axis::holds(false, high);
        let ticks = if holds { axis.ticks(5) } else { Vec::new() };
        for &tick in &ticks {
            let x = left + (axis.position(tick) * f64::from(right - 1 - left)).round() as i32;
            canvas.rect([x, top + 22], [x + 1, top + 27], MUTED);
            canvas.text(&axis.label(tick), [x, top + 36], TEXT, INK, Align::Middle);
        }
        let step = if high > low { (high - low) / 100.0 } else { 0.01 };
        let note = match (below, above) {
            (false, false) => String::new(),
            (false, true) => format!("clipped above {}", number(high, step)),
            (true, false) => format!("clipped below {}", number(low, step)),
            (true, true) => format!("clipped below {} and above {}", number(low, step), number(high, step)),
        };
        let note_width = canvas::text_width(&note, TEXT);
        canvas.text(&note, [width - MARGIN, top + 53], TEXT, MUTED, Align::Right);
        let unit = canvas::fitted(self.unit, TEXT, width - 3 * MARGIN - note_width);
        canvas.text(&unit, [MARGIN + 10, top + 53], TEXT, MUTED, Align::Left);
    }
}

/// A map of colors that stand for no numbers, such as one color per group, with a title above and a note below.
///
/// `colors` is `[height][width]`, top row first; what is missing at the end is white. Small maps are magnified as
/// [`HeatMap::draw`] does.
pub fn draw_labels(width: u32, height: u32, colors: &[[u8; 3]], title: &str, note: &str) -> Rgb8Image {
    const LINE: i32 = 20;
    let room = Frame::new(width, height, title, 0).image_width as i32 - 2 * MARGIN;
    let lines = wrapped(note, room);
    let rows = if lines.is_empty() { 0 } else { lines.len() as u32 * LINE as u32 + 12 };
    let frame = Frame::new(width, height, title, rows);
    let mut image = frame.picture(title, |index| colors.get(index).copied().unwrap_or(PAPER));
    canvas::paint(&mut image, |canvas| {
        for (index, line) in lines.iter().enumerate() {
            let y = frame.below() as i32 + 16 + index as i32 * LINE;
            canvas.text(line, [MARGIN, y], TEXT, MUTED, Align::Left);
        }
    });
    image
}

/// The range from 0 to a percentile (0..=100) of the finite values, rounded up to 1, 2 or 5 times a power of ten; 0 to 1
/// if that is not positive.
pub fn nice_range(values: &[f32], percentile: f32) -> [f32; 2] {
    [0.0, nice_top(values.iter().copied(), percentile)]
}

/// As [`nice_range`] of the magnitudes, to both sides of 0.
pub fn nice_signed_range(values: &[f32], percentile: f32) -> [f32; 2] {
    let top = nice_top(values.iter().map(|value| value.abs()), percentile);
    [-top, top]
}

fn nice_top(values: impl Iterator<Item = f32>, percentile: f32) -> f32 {
    let mut finite: Vec<f32> = values.filter(|value| value.is_finite()).collect();
    if finite.is_empty() {
        return 1.0;
    }
    let rank = (percentile.clamp(0.0, 100.0) / 100.0 * (finite.len() - 1) as f32).ceil() as usize;
    let at = rank.min(finite.len() - 1);
    let (_, &mut value, _) = finite.select_nth_unstable_by(at, f32::total_cmp);
    // Smaller values cannot be told from zero by the eye that reads the number.
    if value > 1e-30 { (round_up(value.into()) as f32).min(f32::MAX) } else { 1.0 }
}

/// Where a map lies in its picture.
struct Frame {
    map: [u32; 2],
    zoom: u32,
    left: u32,
    top: u32,
    image_width: u32,
    image_height: u32,
}

impl Frame {
    fn new(width: u32, height: u32, title: &str, rows_below: u32) -> Self {
        let zoom = (NARROWEST / width.max(height).max(1)).max(1);
        let image_width = (width * zoom).max(NARROWEST);
        let top = if title.is_empty() { 0 } else { TITLE_ROWS };
        let image_height = (top + height * zoom + rows_below).max(1);
        Self { map: [width, height], zoom, left: (image_width - width * zoom) / 2, top, image_width, image_height }
    }

    /// First row below the map.
    fn below(&self) -> u32 {
        self.top + self.map[1] * self.zoom
    }

    /// The picture with its title and a color for each index of the map.
    fn picture(&self, title: &str, color: impl Fn(usize) -> [u8; 3]) -> Rgb8Image {
        let mut image = Rgb8Image::filled(self.image_width, self.image_height, PAPER);
        let [width, height] = self.map;
        for (index, (y, x)) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))).enumerate() {
            let color = color(index);
            for pixel in 0..self.zoom * self.zoom {
                let [dx, dy] = [pixel % self.zoom, pixel / self.zoom];
                image.set(self.left + x * self.zoom + dx, self.top + y * self.zoom + dy, color);
            }
        }
        canvas::paint(&mut image, |canvas| {
            const SIZE: i32 = 18;
            let title = canvas::fitted(title, SIZE, canvas.size()[0] - 2 * MARGIN);
            canvas.text(&title, [MARGIN, 18], SIZE, INK, Align::Left);
        });
        image
    }
}

/// Lines of a text that fit a width, broken at spaces; longer words are cut.
fn wrapped(text: &str, width: i32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if canvas::text_width(&format!("{line} {word}"), TEXT) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(canvas::fitted(word, TEXT, width)),
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
        assert_eq!((image.width, map.place(7, 9)), (500, [7, 9 + TITLE_ROWS, 1]));
        assert_eq!(image.pixel(250, 100), Ramp::Sequential.color(1.0 / 2.0));
    }

    #[test]
    fn the_scale_is_printed_and_says_what_is_clipped() {
        let strip = |values: &[f32]| {
            let image = map(2, 1, values).draw();
            image.pixels[3 * ((image.height - SCALE_ROWS) * image.width) as usize..].to_vec()
        };
        let shown = strip(&[1.0, 2.0]);
        // The bar and its ticks end 27 rows down; below there is nothing but text.
        let text = &shown[3 * 28 * NARROWEST as usize..];
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
    fn ranges_end_at_round_numbers() {
        let values: Vec<f32> = (0..=1000).map(|value| value as f32 / 1000.0).chain([f32::NAN, f32::INFINITY]).collect();
        assert_eq!(nice_range(&values, 99.0), [0.0, 1.0]);
        assert_eq!(nice_range(&values, 15.0), [0.0, 0.2]);
        assert_eq!(nice_range(&[0.02; 3], 100.0), [0.0, 0.02]);
        assert_eq!(nice_range(&[], 99.0), [0.0, 1.0]);
        assert_eq!(nice_range(&[0.0, -3.0], 99.0), [0.0, 1.0]);
        assert_eq!(nice_signed_range(&[0.1, -3.0], 100.0), [-5.0, 5.0]);
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
