//! Pictures and the page `index.html`: what was found, for people.
//!
//! [`write()`] puts everything into a folder: pictures first, the page that refers to them last.

mod maps;
mod pictures;
mod systems;
mod text;

use super::{Findings, Limits, MeasureSettings, Subject, report::Metrics};
use crate::{
    figures::{Page, Rgb8Image},
    output::{OutputError, write_file, write_png},
};
use std::path::{Path, PathBuf};

/// What a page is about.
pub struct Context<'a> {
    /// The file.
    pub subject: &'a Subject<'a>,
    /// What was found.
    pub findings: &'a Findings,
    /// How much was measured.
    pub settings: MeasureSettings,
    /// Name of the file as given.
    pub file: String,
    /// Largest figures allowed.
    pub limits: Limits,
    /// Its size in bytes.
    pub file_bytes: u64,
    /// Wall time of the validation so far, seconds.
    pub seconds: f64,
}

/// Where the pictures of a page go.
struct Folder {
    path: PathBuf,
}

impl Folder {
    /// Writes a picture and returns its name for the page.
    fn picture(&self, name: &str, image: &Rgb8Image) -> Result<String, OutputError> {
        let file = format!("{name}.png");
        write_png(&self.path.join(&file), image.width, image.height, &image.pixels)?;
        Ok(file)
    }

    fn text(&self, file: &str, text: &str) -> Result<(), OutputError> {
        write_file(&self.path.join(file), text.as_bytes())
    }
}

/// Writes pictures, charts and `index.html` into a folder that exists.
///
/// # Errors
/// [`OutputError`]; the page is written last.
pub fn write(folder: &Path, context: &Context<'_>) -> Result<(), OutputError> {
    let folder = Folder { path: folder.to_owned() };
    let metrics = Metrics::of(context.findings, &context.settings);
    let mut sections = Vec::new();
    for index in 0..context.findings.states.len() {
        sections.push(pictures::section(context, &metrics, index, &folder)?);
    }
    sections.push(maps::section(context, &metrics, &folder)?);
    sections.extend(systems::section(context, &folder)?);
    for index in 0..context.findings.sweeps.len() {
        sections.push(maps::sweep_section(context, index, &folder)?);
    }
    sections.push(text::bake_section(context));
    sections.push(text::method_section(context));
    let page = Page {
        title: format!("{}: how good is it?", context.file),
        verdict: text::verdict(context, &metrics),
        sections,
        footer: format!(
            "precompute validate {}, {:.0} s. Figures are also in metrics.json.",
            env!("CARGO_PKG_VERSION"),
            context.seconds
        ),
    };
    folder.text("index.html", &page.render())
}

/// A share in percent, with as many digits as tell something.
fn percent(share: f64) -> String {
    let value = 100.0 * share;
    let digits = match value.abs() {
        0.0 => return "0 %".into(),
        large if large >= 10.0 => 1,
        middle if middle >= 0.1 => 2,
        _ => 4,
    };
    format!("{value:.digits$} %")
}

/// The same with its sign.
fn signed_percent(share: f64) -> String {
    let text = percent(share);
    if share > 0.0 { format!("+{text}") } else { text.replacen('-', "−", 1) }
}
