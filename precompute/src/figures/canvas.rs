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
    /// A filled rectangle between two corners, the second one outside.
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
        draw(&area);
        in_memory(area.present());
    }
    text
}

/// Draws over a picture.
pub(super) fn paint(image: &mut Rgb8Image, draw: impl Fn(&dyn Canvas)) {
    register();
    let size = (image.width, image.height);
    let area = BitMapBackend::with_buffer(&mut image.pixels, size).into_drawing_area();
    draw(&area);
    in_memory(area.present());
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

/// The sequential color map.
pub(super) fn viridis(t: f32) -> [u8; 3] {
    let RGBColor(r, g, b) = ViridisRGB.get_color(t);
    [r, g, b]
}

/// A color between evenly spaced ones.
pub(super) fn blend(colors: &[[u8; 3]], t: f32) -> [u8; 3] {
    let RGBColor(r, g, b) =
        DerivedColorMap::new(&colors.iter().map(|&color| rgb(color)).collect::<Vec<_>>()).get_color(t);
    [r, g, b]
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

impl<B: DrawingBackend> Canvas for DrawingArea<B, Shift> {
    fn size(&self) -> [i32; 2] {
        let (width, height) = self.dim_in_pixel();
        [width as i32, height as i32]
    }

    fn text(&self, text: &str, at: [i32; 2], size: i32, color: [u8; 3], align: Align) {
        let h_pos = match align {
            Align::Left => HPos::Left,
            Align::Middle => HPos::Center,
            Align::Right => HPos::Right,
        };
        let style = font(size).color(&rgb(color)).pos(Pos::new(h_pos, VPos::Center));
        in_memory(self.draw(&Text::new(text, (at[0], at[1]), style)));
    }

    fn rect(&self, from: [i32; 2], to: [i32; 2], color: [u8; 3]) {
        // The library paints the second corner too.
        let corners = [(from[0], from[1]), (to[0] - 1, to[1] - 1)];
        in_memory(self.draw(&Rectangle::new(corners, rgb(color).filled())));
    }

    fn polygon(&self, points: &[[i32; 2]], color: [u8; 3]) {
        let points: Vec<(i32, i32)> = points.iter().map(|point| (point[0], point[1])).collect();
        in_memory(self.draw(&Polygon::new(points, rgb(color).filled())));
    }

    fn plot(&self, [from, to]: [[i32; 2]; 2], [x, y]: [&Axis; 2], names: [&str; 2], lines: &[Line<'_>]) {
        const NUMBERS: i32 = 14;
        let area = self.clone().shrink((from[0], from[1]), (to[0] - from[0], to[1] - from[1]));
        let widest = y.ticks(Scale::Y_TICKS).iter().map(|&tick| text_width(&y.label(tick), NUMBERS)).max().unwrap_or(0);
        let name_room = |name: &str| if name.is_empty() { 0 } else { 24 };
        let mut chart = in_memory(
            ChartBuilder::on(&area)
                .x_label_area_size(26 + name_room(names[0]))
                .y_label_area_size(widest + 14 + name_room(names[1]))
                .margin_right(16)
                .margin_top(6)
                .build_cartesian_2d(Scale(*x, Scale::X_TICKS), Scale(*y, Scale::Y_TICKS)),
        );
        in_memory(
            chart
                .configure_mesh()
                .x_desc(names[0])
                .y_desc(names[1])
                .label_style(font(NUMBERS).color(&rgb(MUTED)))
                .axis_desc_style(font(15).color(&rgb(INK)))
                .axis_style(rgb(MUTED))
                .bold_line_style(rgb(GRID))
                .light_line_style(TRANSPARENT)
                .set_all_tick_mark_size(4)
                .draw(),
        );
        for line in lines {
            let color = rgb(line.color);
            for run in line.runs.iter().filter(|run| run.len() > 1) {
                in_memory(chart.draw_series(LineSeries::new(run.iter().map(|p| (p[0], p[1])), color.stroke_width(2))));
            }
            let dots = line.runs.iter().flatten().map(|p| Circle::new((p[0], p[1]), 3, color.filled()));
            in_memory(chart.draw_series(dots));
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
