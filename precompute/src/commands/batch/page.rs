//! `index.html` of a batch: one table over the pages of all scenes.

use super::super::{grouped, size};
use super::outcome::{HEAD, Outcome, Summary, row, severity};
use localprt_precompute::figures::{Block, Number, Page, Section, Verdict};
use localprt_precompute::inputs::relative_path;
use std::path::Path;

/// The page, for a file in `folder`; paths start, but for this one, at `root`, the folder of the list.
pub fn page(summary: &Summary, root: &Path, folder: &Path) -> Page {
    let scenes = &summary.scenes;
    let n_failed = summary.n_failed();
    let sentence = match n_failed {
        0 => format!("All {} scenes are done.", scenes.len()),
        failed => format!("{failed} of {} scenes failed or missed a limit.", scenes.len()),
    };
    let sum = |value: fn(&Outcome) -> u64| scenes.iter().map(value).sum::<u64>();
    let number = |label: &str, value: String| Number { label: label.into(), value, note: String::new() };
    let bytes = sum(|scene| scene.bake.as_ref().map_or(0, |bake| bake.bytes));
    let receivers = sum(|scene| scene.bake.as_ref().map_or(0, |bake| bake.receivers));
    let fresh = sum(|scene| u64::from(!scene.up_to_date));
    let numbers = vec![
        number("scenes that were new", grouped(fresh)),
        number("all files", size(bytes)),
        number("receivers", grouped(receivers)),
        number("wall time", format!("{:.1} s", summary.seconds)),
    ];
    let mut blocks = vec![table(summary, root, folder)];
    let failures: Vec<(String, String)> = scenes
        .iter()
        .filter_map(|scene| {
            let error = scene.error.as_ref()?;
            let help = error.help.as_ref().map_or_else(String::new, |help| format!(". {help}"));
            Some((scene.name.clone(), format!("{}{help}", error.what)))
        })
        .collect();
    if !failures.is_empty() {
        blocks.push(Block::Facts { title: "What went wrong".into(), rows: failures });
    }
    Page {
        title: format!("{}: {} scenes", summary.list, scenes.len()),
        verdict: Verdict { passed: Some(n_failed == 0), sentence, numbers },
        sections: vec![Section { id: "scenes".into(), title: "Scenes".into(), blocks }],
        footer: format!(
            "precompute batch {}, {} at a time. Figures are also in batch.json.",
            env!("CARGO_PKG_VERSION"),
            summary.jobs
        ),
    }
}

/// Columns of the table on standard output, and the limits that it has no room for.
fn table(summary: &Summary, root: &Path, folder: &Path) -> Block {
    let more = ["leak", "mottling"];
    let cells = |scene: &Outcome| row(scene).into_iter().chain(more.map(|name| scene.figure(name))).collect();
    // A page that is not there has no link.
    let page = |scene: &Outcome| relative_path(folder, &root.join(&scene.validation.as_ref()?.page)).ok();
    Block::Index {
        head: HEAD.iter().chain(&more).map(|name| (*name).to_owned()).collect(),
        rows: summary.scenes.iter().map(cells).collect(),
        pages: summary.scenes.iter().map(page).collect(),
        note: "In the order of the list; the worst is marked. Limits are in brackets behind the figures. Names lead to the \
               pages of the validations."
            .into(),
        highlight_row: worst(&summary.scenes),
    }
}

/// The scene with the worst exit code, of several the one farthest above its limits; without any, that of the largest nrmse.
fn worst(scenes: &[Outcome]) -> Option<usize> {
    let excess = |scene: &Outcome| {
        let figures = scene.validation.iter().flat_map(|validation| validation.figures.values());
        figures.filter_map(|figure| Some(figure.found? / figure.allowed?)).fold(0.0, f64::max)
    };
    let nrmse = |scene: &Outcome| scene.validation.as_ref()?.figures.get("nrmse")?.found;
    let rank = |index: &usize| {
        let scene = &scenes[*index];
        (severity(scene.exit()), excess(scene), nrmse(scene).unwrap_or(0.0))
    };
    let is_above = |a: &usize, b: &usize| {
        let (a, b) = (rank(a), rank(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    };
    (0..scenes.len()).max_by(is_above).filter(|index| rank(index) != (0, 0.0, 0.0))
}

#[cfg(test)]
mod tests {
    use super::super::outcome::{Figure, Validated};
    use super::*;
    use std::collections::BTreeMap;

    fn outcome(name: &str, exit_code: u8, nrmse: f64, allowed: Option<f64>) -> Outcome {
        let figures = BTreeMap::from([("nrmse".into(), Figure { found: Some(nrmse), allowed })]);
        let validated = Validated { page: format!("baked/{name}-quality/index.html"), figures, ..Validated::default() };
        Outcome { name: name.into(), exit_code, validation: Some(validated), ..Outcome::default() }
    }

    #[test]
    fn names_lead_to_pages_and_the_worst_scene_is_marked() {
        let failed = Outcome { name: "gone".into(), exit_code: 6, ..Outcome::default() };
        let scenes = vec![outcome("hall", 0, 0.02, None), outcome("box", 7, 0.3, Some(0.1)), failed];
        assert_eq!(worst(&scenes), Some(2));
        assert_eq!(worst(&scenes[..2]), Some(1));
        assert_eq!(worst(&[outcome("a", 7, 0.2, Some(0.1)), outcome("b", 7, 0.15, Some(0.05))]), Some(1));
        assert_eq!(worst(&[outcome("a", 0, 0.1, None), outcome("b", 0, 0.2, None)]), Some(1), "the largest nrmse");
        assert_eq!(worst(&[Outcome::default()]), None);
        let summary = Summary { list: "levels.toml".into(), exit_code: 6, seconds: 1.0, jobs: 1, threads: 1, scenes };
        let root = tempfile::tempdir().expect("folder");
        for name in ["hall", "box"] {
            let folder = root.path().join(format!("baked/{name}-quality"));
            std::fs::create_dir_all(&folder).expect("made");
            std::fs::write(folder.join("index.html"), "").expect("written");
        }
        let html = page(&summary, root.path(), &root.path().join("baked")).render();
        assert!(
            html.contains("href=\"./hall-quality/index.html\"") && html.contains("href=\"./box-quality/index.html\"")
        );
        assert_eq!(html.matches("<tr class=\"highlight\">").count(), 1);
        assert!(html.contains("2 of 3 scenes failed") && html.contains(">Failed<"));
        assert!(html.find(">hall<") < html.find(">box<"), "in the order of the list");
    }
}
