//! Times with their history, memory, and what the file holds.

use crate::app::App;
use crate::receiver_maps::Legend;
use localprt_runtime::PassTime;
use std::collections::VecDeque;

/// Frames that a history keeps.
const FRAMES: usize = 240;

/// What the panel shows of the last frame.
pub struct Figures<'a> {
    /// What draws.
    pub device: &'a str,
    /// Times of the last frames.
    pub history: &'a History,
    /// Device memory by purpose, bytes.
    pub memory: &'a [(&'static str, u64)],
    /// Gathers since the light was reset.
    pub gathers: u64,
    /// Pixels of the picture.
    pub size: (u32, u32),
    /// What the colors of a map view mean.
    pub legend: Option<&'a Legend>,
    /// Nothing changes any more, so that nothing is drawn again.
    pub is_still: bool,
}

/// Times of the last frames: of whole frames on the CPU's clock, and of every pass on the GPU's.
#[derive(Clone, Debug, Default)]
pub struct History {
    frames_ms: VecDeque<f32>,
    passes_ms: Vec<(&'static str, VecDeque<f32>)>,
}

impl History {
    /// Another frame.
    pub fn push(&mut self, frame_ms: f32, passes: &[PassTime]) {
        push(&mut self.frames_ms, frame_ms);
        for time in passes {
            let milliseconds = time.milliseconds as f32;
            match self.passes_ms.iter_mut().find(|(name, _)| *name == time.name) {
                Some((_, history)) => push(history, milliseconds),
                None => self.passes_ms.push((time.name, VecDeque::from([milliseconds]))),
            }
        }
    }

    /// Median frame time, milliseconds.
    pub fn frame_ms(&self) -> f32 {
        median(&self.frames_ms)
    }
}

fn push(history: &mut VecDeque<f32>, value: f32) {
    if history.len() == FRAMES {
        history.pop_front();
    }
    history.push_back(value);
}

fn median(history: &VecDeque<f32>) -> f32 {
    let mut values: Vec<f32> = history.iter().copied().collect();
    values.sort_unstable_by(f32::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

pub fn summary(ui: &mut egui::Ui, figures: &Figures<'_>) {
    let frame_ms = figures.history.frame_ms();
    ui.label(if figures.is_still {
        format!("{:.1} ms per frame; still", frame_ms)
    } else {
        format!("{:.1} ms per frame, {:.0} per second", frame_ms, 1000.0 / frame_ms.max(1e-3))
    });
}

pub fn figures(ui: &mut egui::Ui, app: &App<'_>, figures: &Figures<'_>) {
    let (width, height) = figures.size;
    ui.label(format!("{}; {width} x {height} pixels; {} gathers", figures.device, figures.gathers));
    egui::Grid::new("times").num_columns(3).striped(true).show(ui, |ui| {
        for title in ["pass", "median ms", "last frames"] {
            ui.strong(title);
        }
        ui.end_row();
        let whole = std::iter::once(("whole frame (CPU clock)", &figures.history.frames_ms));
        for (name, history) in whole.chain(figures.history.passes_ms.iter().map(|(name, history)| (*name, history))) {
            ui.label(name.replace('_', " "));
            ui.label(format!("{:.3}", median(history)));
            curve(ui, history);
            ui.end_row();
        }
    });
    if figures.history.passes_ms.is_empty() {
        ui.label("This device has no timestamps: no times per pass.");
    }
    ui.separator();
    egui::Grid::new("memory").num_columns(2).striped(true).show(ui, |ui| {
        let all: u64 = figures.memory.iter().map(|(_, bytes)| bytes).sum();
        for (what, bytes) in figures.memory.iter().copied().chain([("device memory of the relighter", all)]) {
            ui.label(what);
            ui.label(format!("{:.2} MB", bytes as f64 * 1e-6));
            ui.end_row();
        }
    });
    ui.separator();
    file(ui, app);
}

fn file(ui: &mut egui::Ui, app: &App<'_>) {
    let (baked, scene) = (app.bake.baked.view(), app.bake.scene());
    let n_receivers = baked.receiver_position.len();
    let clusters = &app.bake.baked.transport().clusters;
    let coefficients: usize = clusters.iter().map(|cluster| cluster.lights.len() * cluster.receivers.len()).sum();
    let rows = [
        ("triangles", scene.face_count().to_string()),
        ("probes", baked.probes.len().to_string()),
        ("probe degree", baked.metadata.probe_degree.to_string()),
        ("receivers", n_receivers.to_string()),
        ("receiver degree", baked.metadata.receiver_degree.to_string()),
        ("clusters", clusters.len().to_string()),
        ("coefficients per receiver", format!("{:.1}", coefficients as f64 / n_receivers.max(1) as f64)),
        ("light map", format!("{0} x {0}", baked.metadata.lightmap_size)),
        ("direct light map", format!("{0} x {0}", baked.metadata.direct_size)),
        ("file", format!("{:.1} MB", app.bake.files.baked.file_bytes() as f64 * 1e-6)),
    ];
    egui::Grid::new("file").num_columns(2).striped(true).show(ui, |ui| {
        for (what, value) in rows {
            ui.label(what);
            ui.label(value);
            ui.end_row();
        }
    });
}

/// The values from old to new, from 0 up to their largest.
fn curve(ui: &mut egui::Ui, history: &VecDeque<f32>) {
    let (response, painter) = ui.allocate_painter(egui::vec2(90.0, 16.0), egui::Sense::hover());
    let rect = response.rect;
    let most = history.iter().copied().fold(1e-6, f32::max);
    let point = |(index, value): (usize, &f32)| {
        let x = rect.left() + rect.width() * index as f32 / (FRAMES - 1) as f32;
        egui::pos2(x, rect.bottom() - rect.height() * value / most)
    };
    let points: Vec<egui::Pos2> = history.iter().enumerate().map(point).collect();
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    painter.add(egui::Shape::line(points, egui::Stroke::new(1.0, ui.visuals().hyperlink_color)));
    response.on_hover_text(format!("largest {most:.3} ms"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_history_forgets_and_knows_its_median() {
        let mut history = History::default();
        for frame in 0..FRAMES + 101 {
            let pass = PassTime { name: "scene", milliseconds: 2.0, runs: 1 };
            history.push(frame as f32, &[pass]);
        }
        // The last 240 of 0..=340: from 101 to 340.
        assert_eq!((history.frames_ms.len(), history.frame_ms()), (FRAMES, 221.0));
        assert_eq!(median(&history.passes_ms[0].1), 2.0);
    }
}
