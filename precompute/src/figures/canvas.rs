//! What figures are drawn on: an SVG text or pixels. The only file that names the plotting library and the font.

use super::Rgb8Image;
use super::axis::Axis;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::register_font;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;
use std::sync::Once;

/// Background of figures. The page replaces this color, [`INK`], [`MUTED`] and [`GRID`] in SVG by those of its scheme.
pub(super) const PAPER: [u8; 3] = [255, 255, 255];
/// Titles.
pub(super) const INK: [u8; 3] = [29, 35, 43];
/// Axes, numbers and notes.
pub(super) const MUTED: [u8; 3] = [90, 99, 112];
/// Lines behind the data.
pub(super) const GRID: [u8; 3] = [226, 230, 235];

/// A series in a plot: runs of neighbors that a line joins, in the order of the axis values.
pub(super) struct Line<'a> {
    pub color: [u8; 3],
    pub runs: &'a [Vec<[f64; 2]>],
}

/// Where a text starts, or ends, or has its middle; texts are centered on the height of their place.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Middle,
    Right,
}

/// A surface of pixels, counted from the top left.
pub(super) trait Canvas {
    /// Width and height.
    fn size(&self) -> [i32; 2];
    /// Text at a place: its height centered on `at`.
    fn text(&self, text: &str, at: [i32; 2], size: i32, color: [u8; 3], align: Align);
    /// A filled rectangle from one corner up to another one.
    fn rect(&self, from: [i32; 2], to: [i32; 2], color: [u8; 3]);
    /// A filled outline.
    fn polygon(&self, points: &[[i32; 2]], color: [u8; 3]);
    /// Axes with grid, numbers and names inside a box, and lines with a dot at each point.
    fn plot(&self, within: [[i32; 2]; 2], axes: [&Axis; 2], names: [&str; 2], lines: &[Line<'_>]);
}

/// Draws as SVG.
pub(super) fn svg(width: u32, height: u32, draw: impl Fn(&dyn Canvas)) -> String {
    register();
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (width, height)).into_drawing_area();
        in_memory(area.fill(&rgb(PAPER)));
        let surface = Surface { area, zoom: 1, drop: 0.0 };
        draw(&surface);
        in_memory(surface.area.present());
    }
    text
}

/// Draws as pixels.
pub(super) fn image(width: u32, height: u32, draw: impl Fn(&dyn Canvas)) -> Rgb8Image {
    /// The library puts letters and edges on whole pixels, which shows unless these are smaller than those of the picture.
    const FINER: u32 = 3;
    register();
    let mut large = Rgb8Image::filled(width * FINER, height * FINER, PAPER);
    {
        let size = (large.width, large.height);
        let area = BitMapBackend::with_buffer(&mut large.pixels, size).into_drawing_area();
        let surface = Surface { area, zoom: FINER as i32, drop: 0.1 };
        draw(&surface);
        in_memory(surface.area.present());
    }
    let mut small = Rgb8Image::filled(width, height, PAPER);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let mut sum = [0; 3];
        for part in 0..FINER * FINER {
            let color = large.pixel(x * FINER + part % FINER, y * FINER + part / FINER);
            sum = [0, 1, 2].map(|channel| sum[channel] + u32::from(color[channel]));
        }
        small.set(x, y, sum.map(|sum| (sum / (FINER * FINER)) as u8));
    }
    small
}

/// Width of a text in pixels.
pub(super) fn text_width(text: &str, size: i32) -> i32 {
    register();
    let bounds = font(size).layout_box(text).map(|(from, to)| to.0 - from.0);
    bounds.unwrap_or(text.chars().count() as i32 * size / 2)
}

/// The start of a text that fits a width, with an ellipsis where something was left out.
pub(super) fn fitted(text: &str, size: i32, width: i32) -> String {
    if text_width(text, size) <= width {
        return text.into();
    }
    let mut kept: Vec<char> = text.chars().collect();
    while kept.pop().is_some() {
        let short = format!("{}…", kept.iter().collect::<String>().trim_end());
        if text_width(&short, size) <= width {
            return short;
        }
    }
    String::new()
}

/// Registers the typeface of all figures, once: the library finds no fonts of the system.
fn register() {
    static FONT: Once = Once::new();
    FONT.call_once(|| {
        let registered = register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
        assert!(registered.is_ok(), "the bundled font is a font");
    });
}

/// Drawing into memory with a registered font has nothing that can fail.
fn in_memory<T, E: std::fmt::Debug>(result: Result<T, E>) -> T {
    result.expect("drawing into memory succeeds")
}

fn rgb([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

fn font(size: i32) -> FontDesc<'static> {
    ("sans-serif", size).into_font()
}

/// A drawing area whose pixels are `zoom` times smaller than those that figures count.
struct Surface<B: DrawingBackend> {
    area: DrawingArea<B, Shift>,
    zoom: i32,
    /// How far to lower texts, as a share of their size: the library centers the letters of SVG, but those of pixels too
    /// high, as seen beside a line.
    drop: f64,
}

impl<B: DrawingBackend> Surface<B> {
    fn at(&self, point: [i32; 2]) -> (i32, i32) {
        (point[0] * self.zoom, point[1] * self.zoom)
    }

    fn font(&self, size: i32, color: [u8; 3]) -> TextStyle<'static> {
        font(size * self.zoom).color(&rgb(color))
    }

    fn stroke(&self, width: i32, color: [u8; 3]) -> ShapeStyle {
        rgb(color).stroke_width((width * self.zoom) as u32)
    }
}

impl<B: DrawingBackend> Canvas for Surface<B> {
    fn size(&self) -> [i32; 2] {
        let (width, height) = self.area.dim_in_pixel();
        [width as i32 / self.zoom, height as i32 / self.zoom]
    }

    fn text(&self, text: &str, at: [i32; 2], size: i32, color: [u8; 3], align: Align) {
        let h_pos = match align {
            Align::Left => HPos::Left,
            Align::Middle => HPos::Center,
            Align::Right => HPos::Right,
        };
        let style = self.font(size, color).pos(Pos::new(h_pos, VPos::Center));
        let (x, y) = self.at(at);
        let y = y + (self.drop * f64::from(size * self.zoom)).round() as i32;
        in_memory(self.area.draw(&Text::new(text, (x, y), style)));
    }

    fn rect(&self, from: [i32; 2], to: [i32; 2], color: [u8; 3]) {
        in_memory(self.area.draw(&Rectangle::new([self.at(from), self.at(to)], rgb(color).filled())));
    }

    fn polygon(&self, points: &[[i32; 2]], color: [u8; 3]) {
        let points: Vec<(i32, i32)> = points.iter().map(|&point| self.at(point)).collect();
        in_memory(self.area.draw(&Polygon::new(points, rgb(color).filled())));
    }

    fn plot(&self, [from, to]: [[i32; 2]; 2], [x, y]: [&Axis; 2], names: [&str; 2], lines: &[Line<'_>]) {
        const NUMBERS: i32 = 16;
        let area = self.area.clone().shrink(self.at(from), self.at([to[0] - from[0], to[1] - from[1]]));
        let widest = y.ticks(Scale::Y_TICKS).iter().map(|&tick| text_width(&y.label(tick), NUMBERS)).max().unwrap_or(0);
        let name_room = |name: &str| if name.is_empty() { 0 } else { 24 };
        let mut chart = in_memory(
            ChartBuilder::on(&area)
                .x_label_area_size((26 + name_room(names[0])) * self.zoom)
                .y_label_area_size((widest + 14 + name_room(names[1])) * self.zoom)
                .margin_right(20 * self.zoom)
                .margin_top(10 * self.zoom)
                .build_cartesian_2d(Scale(*x, Scale::X_TICKS), Scale(*y, Scale::Y_TICKS)),
        );
        in_memory(
            chart
                .configure_mesh()
                .x_desc(names[0])
                .y_desc(names[1])
                .label_style(self.font(NUMBERS, INK))
                .axis_desc_style(self.font(16, MUTED))
                .axis_style(self.stroke(1, MUTED))
                .bold_line_style(self.stroke(1, GRID))
                .light_line_style(TRANSPARENT)
                .set_all_tick_mark_size(4 * self.zoom)
                .draw(),
        );
        for line in lines {
            for run in line.runs.iter().filter(|run| run.len() > 1) {
                let points = run.iter().map(|point| (point[0], point[1]));
                in_memory(chart.draw_series(LineSeries::new(points, self.stroke(2, line.color))));
            }
            let dot = |p: &[f64; 2]| Circle::new((p[0], p[1]), 3 * self.zoom, rgb(line.color).filled());
            in_memory(chart.draw_series(line.runs.iter().flatten().map(dot)));
        }
    }
}

/// An axis in the words of the library, with the number of ticks wanted.
struct Scale(Axis, usize);

impl Scale {
    const X_TICKS: usize = 8;
    const Y_TICKS: usize = 6;
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        from + (self.0.position(*value) * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.0.ticks(self.1)
    }

    fn range(&self) -> Range<f64> {
        self.0.low..self.0.high
    }
}

impl ValueFormatter<f64> for Scale {
    fn format_ext(&self, value: &f64) -> String {
        self.0.label(*value)
    }
}
