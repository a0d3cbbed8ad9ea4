//! Bar charts: a table of names and numbers to compare by length.

use super::Rgb8Image;
use super::axis::{Axis, number};
use super::canvas::{self, Align, Canvas, GRID, INK, MUTED};
use super::chart::{PALETTE, SMALLEST, draw_title};

/// Horizontal bars from zero, each with its name before and its number behind it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BarChart {
    /// Above the figure.
    pub title: String,
    /// Name and unit of the numbers.
    pub x_label: String,
    /// Names and numbers, from the top. A number that is not finite gets no bar and is printed as a dash.
    pub bars: Vec<(String, f64)>,
}

impl BarChart {
    /// As an SVG image, `width` by `height` pixels at its natural size; 30 pixels per bar and 80 more look well.
    pub fn to_svg(&self, width: u32, height: u32) -> String {
        canvas::svg(width.max(SMALLEST[0]), self.height(height), |canvas| self.draw(canvas))
    }

    /// As pixels.
    pub fn to_image(&self, width: u32, height: u32) -> Rgb8Image {
        canvas::image(width.max(SMALLEST[0]), self.height(height), |canvas| self.draw(canvas))
    }

    /// As asked, but enough to read every name.
    fn height(&self, asked: u32) -> u32 {
        asked.max(80 + 18 * self.bars.len() as u32)
    }

    fn draw(&self, canvas: &dyn Canvas) {
        const SIZE: i32 = 16;
        let [width, height] = canvas.size();
        let top = draw_title(canvas, &self.title) + 4;
        let bottom = height - if self.x_label.is_empty() { 10 } else { 36 };
        let holds = |value: f64| Axis::holds(false, value);
        let values = || self.bars.iter().map(|bar| bar.1).filter(|&value| holds(value));
        let axis = Axis::around(values().chain([0.0]), false);
        // Three digits that count: two decimals of what the axis is long.
        let texts: Vec<String> = (self.bars.iter())
            .map(|bar| if holds(bar.1) { number(bar.1, bar.1.abs() / 100.0) } else { "–".into() })
            .collect();
        let widest =
            |texts: &mut dyn Iterator<Item = &String>| texts.map(|t| canvas::text_width(t, SIZE)).max().unwrap_or(0);
        let name_room = widest(&mut self.bars.iter().map(|bar| &bar.0)).min(2 * width / 5);
        let number_room = widest(&mut texts.iter()) + 8;
        // Numbers of negative bars stand to their left.
        let left = 16 + name_room + 12 + if axis.low < 0.0 { number_room } else { 0 };
        let right = (width - 16 - number_room).max(left + 20);
        let place = |value: f64| left + (axis.position(value) * f64::from(right - left)).round() as i32;
        let row = (f64::from(bottom - top) / self.bars.len().max(1) as f64).min(44.0);
        let used = top + (row * self.bars.len() as f64) as i32;
        for tick in axis.ticks(5) {
            canvas.rect([place(tick), top], [place(tick) + 1, used], GRID);
        }
        for (index, ((name, value), text)) in self.bars.iter().zip(&texts).enumerate() {
            let middle = top + (row * (index as f64 + 0.5)) as i32;
            canvas.text(&canvas::fitted(name, SIZE, name_room), [16 + name_room, middle], SIZE, INK, Align::Right);
            let end = if holds(*value) { place(*value) } else { place(0.0) };
            let half = ((row * 0.3) as i32).max(3);
            let (from, to) = (end.min(place(0.0)), end.max(place(0.0)));
            if from < to {
                canvas.rect([from, middle - half], [to, middle + half], PALETTE[0]);
            }
            let (x, align) = if *value < 0.0 { (end - 6, Align::Right) } else { (end + 6, Align::Left) };
            canvas.text(text, [x, middle], SIZE, INK, align);
        }
        canvas.rect([place(0.0), top], [place(0.0) + 1, used], MUTED);
        canvas.text(&self.x_label, [left, used + 18], SIZE, MUTED, Align::Left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_as_long_as_their_numbers() {
        let bars = vec![("double".to_owned(), 8.0), ("single".to_owned(), 4.0), ("none".to_owned(), f64::NAN)];
        let chart = BarChart { title: "Sizes".into(), x_label: "MB".into(), bars };
        let image = chart.to_image(640, 200);
        let lengths: Vec<usize> = (0..image.height)
            .map(|y| (0..image.width).filter(|&x| image.pixel(x, y) == PALETTE[0]).count())
            .filter(|&length| length > 0)
            .collect();
        let (longest, shortest) = (lengths.iter().max().expect("a bar"), lengths.iter().min().expect("a bar"));
        // Ends are rounded to pixels.
        assert!(longest.abs_diff(2 * shortest) <= 2, "{longest} {shortest}");
        let svg = chart.to_svg(640, 200);
        assert!(["double", "single", "none", "MB", "–"].iter().all(|text| svg.contains(text)));
    }

    #[test]
    fn odd_bars_are_drawn_without_a_panic() {
        for value in [f64::NAN, f64::INFINITY, f64::MAX, -1.0, 0.0, 1e-320] {
            let bars = vec![("a long name ".repeat(30), value); 40];
            BarChart { bars, ..BarChart::default() }.to_image(0, 0);
        }
        assert!(BarChart::default().to_svg(0, 0).contains("<svg"));
    }
}
