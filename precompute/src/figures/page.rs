//! A report page: one HTML file that opens from disk, in any browser, with no network and also without scripts.

use super::page_blocks::blocks;
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A report page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    /// What the page is about.
    pub title: String,
    /// The answer, first and large.
    pub verdict: Verdict,
    /// What it rests on, in order.
    pub sections: Vec<Section>,
    /// Last line: what made the page.
    pub footer: String,
}

/// The answer of a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Whether what was asked for is met; `None` where nothing was asked.
    pub passed: Option<bool>,
    /// The answer in one sentence.
    pub sentence: String,
    /// The numbers behind it, four at best.
    pub numbers: Vec<Number>,
}

/// A number of a verdict.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Number {
    /// What it is.
    pub label: String,
    /// The number with its unit.
    pub value: String,
    /// What to hold it against.
    pub note: String,
}

/// A part of a page, listed in its contents.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Name in links to it: one word, unique on the page.
    pub id: String,
    /// Heading.
    pub title: String,
    /// What it shows, in order.
    pub blocks: Vec<Block>,
}

/// A piece of a section. Empty titles, captions and notes take no room.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// Pictures of one size laid over each other: a handle wipes between two of them and a button flips. Without scripts
    /// they stand side by side.
    Compare {
        /// Heading.
        title: String,
        /// What to look for.
        caption: String,
        /// Two or more; the first two are shown first.
        images: Vec<NamedImage>,
    },
    /// Pictures side by side.
    Gallery {
        /// Heading.
        title: String,
        /// Pictures of any sizes.
        images: Vec<NamedImage>,
        /// Pictures per row, where there is room.
        columns: u32,
    },
    /// A table.
    Table {
        /// Heading.
        title: String,
        /// Names of the columns.
        head: Vec<String>,
        /// `[n_rows][n_columns]`.
        rows: Vec<Vec<String>>,
        /// Below the table.
        note: String,
        /// Index of a row to point out.
        highlight_row: Option<usize>,
    },
    /// A table whose rows lead to other pages.
    Index {
        /// Names of the columns.
        head: Vec<String>,
        /// `[n_rows][n_columns]`.
        rows: Vec<Vec<String>>,
        /// `[n_rows]` where the first cell of each row leads: a path relative to this page.
        pages: Vec<Option<String>>,
        /// Below the table.
        note: String,
        /// Index of a row to point out.
        highlight_row: Option<usize>,
    },
    /// Names and values.
    Facts {
        /// Heading.
        title: String,
        /// Name, value.
        rows: Vec<(String, String)>,
    },
    /// A drawing that is part of the page.
    Svg {
        /// Heading.
        title: String,
        /// An SVG element, taken as it is: not escaped.
        svg: String,
        /// The same drawing as a file to link to, relative to the page.
        png: Option<String>,
    },
    /// Blocks that open on a click.
    Details {
        /// What to click.
        title: String,
        /// What opens.
        blocks: Vec<Block>,
    },
}

/// A picture file with its name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NamedImage {
    /// Short name, to choose it by.
    pub name: String,
    /// Path relative to the page, with forward slashes.
    pub file: String,
    /// What it shows.
    pub caption: String,
}

impl Page {
    /// The page as one HTML file. All text is escaped; styles and scripts are part of it, picture files are not.
    pub fn render(&self) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (self.title) }
                    style { (PreEscaped(include_str!("page.css"))) }
                }
                body {
                    header.top { h1 { (self.title) } (self.verdict.markup()) }
                    div.columns {
                        @if !self.sections.is_empty() { (self.contents()) }
                        main {
                            @for section in &self.sections {
                                section id=(section.id) { h2 { (section.title) } (blocks(&section.blocks)) }
                            }
                        }
                    }
                    @if !self.footer.is_empty() { footer { (self.footer) } }
                    script { (PreEscaped(include_str!("page.js"))) }
                }
            }
        };
        page.into_string()
    }

    fn contents(&self) -> Markup {
        html! {
            nav aria-label="Contents" {
                ol {
                    @for section in &self.sections {
                        li { a href={ "#" (section.id) } { (section.title) } }
                    }
                }
            }
        }
    }
}

impl Verdict {
    fn markup(&self) -> Markup {
        let (class, word) = match self.passed {
            Some(true) => ("passed", "Passed"),
            Some(false) => ("failed", "Failed"),
            None => ("open", ""),
        };
        html! {
            div class={ "verdict " (class) } {
                @if !word.is_empty() { span.stamp { (word) } }
                p.sentence { (self.sentence) }
                @if !self.numbers.is_empty() {
                    dl.numbers {
                        @for number in &self.numbers {
                            div {
                                dt { (number.label) }
                                dd.value { (number.value) }
                                @if !number.note.is_empty() { dd.note { (number.note) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTILE: &str = "<script>alert('x')</script>\"&";

    fn text() -> String {
        HOSTILE.into()
    }

    fn images(files: &[&str]) -> Vec<NamedImage> {
        files.iter().map(|&file| NamedImage { name: text(), file: file.into(), caption: text() }).collect()
    }

    fn page() -> Page {
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\"></svg>".to_owned();
        let blocks = vec![
            Block::Text(text()),
            Block::Compare { title: text(), caption: text(), images: images(&["a.png", "b.png", "sub/c #1.png"]) },
            Block::Gallery { title: text(), images: images(&["d.png", HOSTILE]), columns: 3 },
            Block::Table {
                title: text(),
                head: vec![text(), text()],
                rows: vec![vec![text(), "1.5 MB".into()], vec![text()]],
                note: text(),
                highlight_row: Some(1),
            },
            Block::Index {
                head: vec![text()],
                rows: vec![vec![text()], vec![text()]],
                pages: vec![Some("sub/e.html".into()), None],
                note: text(),
                highlight_row: None,
            },
            Block::Facts { title: text(), rows: vec![(text(), text())] },
            Block::Svg { title: text(), svg, png: Some(text()) },
            Block::Details { title: text(), blocks: vec![Block::Text(text())] },
        ];
        let numbers = vec![Number { label: text(), value: text(), note: text() }];
        Page {
            title: text(),
            verdict: Verdict { passed: Some(true), sentence: text(), numbers },
            sections: vec![Section { id: text(), title: text(), blocks }],
            footer: text(),
        }
    }

    #[test]
    fn text_is_never_markup() {
        let html = page().render();
        // The one script of the page itself.
        assert_eq!(html.matches("<script").count(), 1);
        // Every text above, in content and in attributes, file names with their own encoding included.
        assert!(html.matches("&lt;script&gt;").count() > 25);
        assert!(!html.contains("x')</script>\"&"));
    }

    #[test]
    fn nothing_is_fetched_from_elsewhere() {
        let html = page().render().replace("http://www.w3.org/2000/svg", "");
        for word in ["http://", "https://", "//fonts", "@import", "url("] {
            assert!(!html.contains(word), "{word}");
        }
    }

    #[test]
    fn every_picture_is_shown_by_its_relative_path() {
        let html = page().render();
        for file in ["./a.png", "./b.png", "./sub/c %231.png", "./d.png"] {
            assert!(html.contains(&format!("src=\"{file}\"")), "{file}");
            assert!(html.contains(&format!("href=\"{file}\"")), "{file} opens");
        }
        assert_eq!(html.matches("<img ").count(), 5);
        assert_eq!(html.matches("href=\"./sub/e.html\"").count(), 1, "rows lead to their pages");
    }

    #[test]
    fn the_verdict_comes_first_and_is_said_in_words() {
        for (passed, word) in [(Some(true), Some("Passed")), (Some(false), Some("Failed")), (None, None)] {
            let mut page = page();
            page.verdict.passed = passed;
            page.verdict.sentence = "the answer".into();
            let html = page.render();
            let at = |text: &str| html.find(text);
            assert!(at("the answer") < at("<nav") && at("<nav").is_some());
            assert_eq!(["Passed", "Failed"].into_iter().find(|word| at(&format!(">{word}<")).is_some()), word);
        }
    }

    #[test]
    fn drawings_take_the_colors_of_the_page() {
        use crate::figures::canvas::{GRID, INK, MUTED, PAPER};
        for [r, g, b] in [PAPER, INK, MUTED, GRID] {
            let rule = format!(".drawing [fill=\"#{r:02X}{g:02X}{b:02X}\"]");
            assert!(include_str!("page.css").contains(&rule), "{rule}");
        }
    }

    #[test]
    fn an_empty_page_is_a_page() {
        let html = Page::default().render();
        assert!(html.starts_with("<!DOCTYPE html>") && !html.contains("<nav") && !html.contains("<footer"));
    }
}
