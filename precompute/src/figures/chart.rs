//! Line charts, as SVG or as pixels.

use super::Rgb8Image;
use super::axis::Axis;
use super::canvas::{self, Align, Canvas, INK, Line, MUTED};

/// Colors of series in their order, then again from the first: told apart by most readers, on white and on near black.
pub(super) const PALETTE: [[u8; 3]; 8] = [
    [46, 111, 216],
    [217, 98, 43],
    [42, 157, 111],
    [176, 64, 154],
    [140, 122, 30],
    [199, 58, 74],
    [28, 147, 168],
    [107, 114, 128],
];

/// Smallest figure, in pixels: less holds no axes. Smaller sizes are raised to this.
pub(super) const SMALLEST: [u32; 2] = [320, 220];

/// Lines with a dot at every point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Above the figure.
    pub title: String,
    /// Name and unit of the horizontal axis.
    pub x_label: String,
    /// Name and unit of the vertical axis.
    pub y_label: String,
    /// Whether the horizontal axis is logarithmic.
    pub x_log: bool,
    /// Whether the vertical axis is logarithmic.
    pub y_log: bool,
    /// The lines, first one at the back.
    pub series: Vec<Series>,
}

/// One line of a chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// `[n][x, y]` in the order in which the line joins them. Points that are not finite, or not positive on a logarithmic
    /// axis, are left out, interrupt the line and are counted in the legend.
    pub points: Vec<[f64; 2]>,
}

impl Chart {
    /// As an SVG image, `width` by `height` pixels at its natural size.
    pub fn to_svg(&self, width: u32, height: u32) -> String {
        canvas::svg(width.max(SMALLEST[0]), height.max(SMALLEST[1]), |canvas| self.draw(canvas))
    }

    /// As pixels.
    pub fn to_image(&self, width: u32, height: u32) -> Rgb8Image {
        canvas::image(width.max(SMALLEST[0]), height.max(SMALLEST[1]), |canvas| self.draw(canvas))
    }

    fn draw(&self, canvas: &dyn Canvas) {
        let [width, height] = canvas.size();
        let mut top = draw_title(canvas, &self.title);
        top = self.draw_legend(canvas, top);
        let runs: Vec<Vec<Vec<[f64; 2]>>> = self.series.iter().map(|series| self.runs(series)).collect();
        let axis = |index: usize, log| Axis::around(runs.iter().flatten().flatten().map(|point| point[index]), log);
        let lines: Vec<Line<'_>> =
            (runs.iter().zip(PALETTE.iter().cycle())).map(|(runs, &color)| Line { color, runs }).collect();
        let axes = [&axis(0, self.x_log), &axis(1, self.y_log)];
        canvas.plot([[10, top], [width, height - 6]], axes, [&self.x_label, &self.y_label], &lines);
    }

    /// Names with a stroke of their color, wrapped. Returns where the plot begins.
    fn draw_legend(&self, canvas: &dyn Canvas, top: i32) -> i32 {
        const SIZE: i32 = 16;
        let width = canvas.size()[0];
        let left_out: usize = self.series.iter().flat_map(|series| &series.points).filter(|p| !self.holds(p)).count();
        let note = match left_out {
            0 => String::new(),
            1 => "1 point not shown".into(),
            n => format!("{n} points not shown"),
        };
        let entries = self.series.iter().zip(PALETTE.iter().cycle()).map(|(series, color)| (&series.name, Some(color)));
        let note = Some((&note, None)).filter(|(note, _)| !note.is_empty());
        let [mut x, mut y] = [16, top + 10];
        let mut any = false;
        for (name, color) in entries.chain(note) {
            let swatch = if color.is_some() { 24 } else { 0 };
            let name = canvas::fitted(name, SIZE, width - 32 - swatch);
            let needed = swatch + canvas::text_width(&name, SIZE);
            if any && x + needed > width - 16 {
                [x, y] = [16, y + 20];
            }
            if let Some(&color) = color {
                canvas.rect([x, y - 1], [x + 18, y + 2], color);
            }
            canvas.text(&name, [x + swatch, y], SIZE, if color.is_some() { INK } else { MUTED }, Align::Left);
            x += needed + 22;
            any = true;
        }
        // However many names there are, the plot keeps some room.
        (y + if any { 16 } else { 0 }).min(canvas.size()[1] - 140)
    }

    fn holds(&self, point: &[f64; 2]) -> bool {
        Axis::holds(self.x_log, point[0]) && Axis::holds(self.y_log, point[1])
    }

    /// The points of a series that have a place, cut where one has none.
    fn runs(&self, series: &Series) -> Vec<Vec<[f64; 2]>> {
        let runs = series.points.split(|point| !self.holds(point));
        runs.filter(|run| !run.is_empty()).map(<[_]>::to_vec).collect()
    }
}

/// A title line. Returns where the rest begins.
pub(super) fn draw_title(canvas: &dyn Canvas, title: &str) -> i32 {
    const SIZE: i32 = 21;
    if title.is_empty() {
        return 8;
    }
    let title = canvas::fitted(title, SIZE, canvas.size()[0] - 32);
    canvas.text(&title, [16, 20], SIZE, INK, Align::Left);
    38
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(name: &str, points: &[[f64; 2]]) -> Series {
        Series { name: name.into(), points: points.to_vec() }
    }

    #[test]
    fn a_chart_names_every_series_and_marks_every_point() {
        let chart = Chart {
            title: "Error <b>&</b> size".into(),
            x_label: "bytes".into(),
            y_label: "error".into(),
            y_log: true,
            series: vec![
                series("first", &[[1.0, 0.1], [2.0, 0.01], [3.0, 0.0], [4.0, 0.02]]),
                series("second <script>", &[[1.0, 0.5], [f64::NAN, 0.3]]),
            ],
            ..Chart::default()
        };
        let svg = chart.to_svg(640, 400);
        assert_eq!(svg.matches("<circle").count(), 4);
        let joined = |[r, g, b]: [u8; 3]| {
            let color = format!("#{r:02X}{g:02X}{b:02X}");
            svg.lines().filter(|line| line.starts_with("<polyline") && line.contains(&color)).count()
        };
        assert_eq!((joined(PALETTE[0]), joined(PALETTE[1])), (1, 0), "a run of two points, single ones");
        for text in ["first", "second &lt;script&gt;", "bytes", "error", "2 points not shown", "sans-serif"] {
            assert!(svg.contains(text), "{text} is missing");
        }
        assert!(!svg.contains("<script>") && !svg.contains("<b>"));
    }

    #[test]
    fn pixels_show_the_color_of_the_line() {
        let chart = Chart { series: vec![series("a", &[[0.0, 0.0], [1.0, 1.0]])], ..Chart::default() };
        let image = chart.to_image(400, 300);
        assert_eq!(image.pixels.len(), 400 * 300 * 3);
        let colored = image.pixels.chunks_exact(3).filter(|pixel| *pixel == PALETTE[0].as_slice()).count();
        assert!(colored > 250, "{colored}");
    }

    #[test]
    fn odd_data_is_drawn_without_a_panic() {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, -1.0, 1e-320, f64::MAX, f64::MIN, 5.0];
        let all: Vec<[f64; 2]> = odd.iter().flat_map(|&x| odd.map(|y| [x, y])).collect();
        let many = (0..60).map(|i| series(&format!("a rather long name number {i}"), &[[i as f64, 1.0]])).collect();
        let cases =
            [vec![], vec![series("", &[])], vec![series("one", &[[3.0, 3.0]])], vec![series("odd", &all)], many];
        for series in cases {
            for (x_log, y_log) in [(false, false), (true, false), (false, true), (true, true)] {
                let title = "long ".repeat(100);
                let chart = Chart { title, x_log, y_log, series: series.clone(), ..Chart::default() };
                assert!(chart.to_svg(500, 300).ends_with("</svg>\n"));
                chart.to_image(1, 0);
            }
        }
    }
}
