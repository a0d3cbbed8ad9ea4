//! The markup of each kind of block on a report page.

use super::page::{Block, NamedImage};
use maud::{Markup, PreEscaped, html};

/// Blocks in order.
pub(super) fn blocks(blocks: &[Block]) -> Markup {
    html! { @for block in blocks { (one(block)) } }
}

fn one(block: &Block) -> Markup {
    match block {
        Block::Text(text) => html! { p.text { (text) } },
        Block::Compare { title, caption, images } => compare(title, caption, images),
        Block::Gallery { title, images, columns } => html! {
            div.block { (heading(title)) (grid(images, *columns)) }
        },
        Block::Table { title, head, rows, note, highlight_row } => table(title, head, rows, &[], note, *highlight_row),
        Block::Index { head, rows, pages, note, highlight_row } => table("", head, rows, pages, note, *highlight_row),
        Block::Facts { title, rows } => html! {
            div.block {
                (heading(title))
                dl.facts { @for (name, value) in rows { div { dt { (name) } dd { (value) } } } }
            }
        },
        Block::Svg { title, svg, png } => html! {
            figure.block.drawing {
                (heading(title))
                div.scroll role=[(!title.is_empty()).then_some("img")] aria-label=[Some(title).filter(|title| !title.is_empty())] { (PreEscaped(svg)) }
                @if let Some(file) = png { figcaption { a href=(address(file)) { "PNG file" } } }
            }
        },
        Block::Details { title, blocks: inner } => html! {
            details.block { summary { (title) } (blocks(inner)) }
        },
    }
}

fn heading(title: &str) -> Markup {
    html! { @if !title.is_empty() { h3 { (title) } } }
}

/// The script builds the wipe from the pictures of the grid, which is all there is without it.
fn compare(title: &str, caption: &str, images: &[NamedImage]) -> Markup {
    html! {
        div.block.compare {
            (heading(title))
            @if !caption.is_empty() { p.caption { (caption) } }
            (grid(images, images.len().clamp(1, 3) as u32))
        }
    }
}

fn grid(images: &[NamedImage], columns: u32) -> Markup {
    html! {
        div.grid style={ "--columns:" (columns.clamp(1, 12)) } {
            @for image in images {
                figure {
                    a href=(address(&image.file)) {
                        img src=(address(&image.file)) alt=(image.name) loading="lazy" decoding="async";
                    }
                    figcaption {
                        @if !image.name.is_empty() { b { (image.name) } }
                        @if !image.caption.is_empty() { span { (image.caption) } }
                    }
                }
            }
        }
    }
}

fn table(
    title: &str,
    head: &[String],
    rows: &[Vec<String>],
    pages: &[Option<String>],
    note: &str,
    highlight_row: Option<usize>,
) -> Markup {
    // A column of numbers is lined up at the right, its name too.
    let columns = rows.iter().map(Vec::len).chain([head.len()]).max().unwrap_or(0);
    let is_number: Vec<bool> = (0..columns).map(|column| is_number_column(rows, column)).collect();
    let class = |column: usize| is_number[column].then_some("number");
    html! {
        div.block {
            (heading(title))
            div.scroll tabindex="0" {
                table {
                    @if !head.is_empty() {
                        thead { tr { @for (column, name) in head.iter().enumerate() {
                            th scope="col" class=[class(column)] { (name) }
                        } } }
                    }
                    tbody { @for (index, row) in rows.iter().enumerate() {
                        tr class=[(highlight_row == Some(index)).then_some("highlight")] {
                            @for (column, cell) in row.iter().enumerate() {
                                td class=[class(column)] {
                                    @match pages.get(index).and_then(Option::as_ref).filter(|_| column == 0) {
                                        Some(page) => { a href=(address(page)) { (cell) } }
                                        None => { (cell) }
                                    }
                                }
                            }
                        }
                    } }
                }
            }
            @if !note.is_empty() { p.caption { (note) } }
        }
    }
}

/// Whether the cells of a column start like numbers; empty ones and dashes do not count.
fn is_number_column(rows: &[Vec<String>], column: usize) -> bool {
    let cells = rows.iter().filter_map(|row| row.get(column));
    let mut said = cells.map(|cell| cell.trim()).filter(|cell| !matches!(*cell, "" | "-" | "–" | "—")).peekable();
    said.peek().is_some()
        && said.all(|cell| {
            let digits = cell.trim_start_matches(['+', '-', '−', '<', '>', '≤', '≥', '±', '~', ' ']);
            digits.starts_with(|first: char| first.is_ascii_digit())
        })
}

/// A relative path as the address of a link: characters that mean something else in an address are encoded, and the dot
/// in front keeps a name with a colon from being read as a scheme.
fn address(file: &str) -> String {
    format!("./{}", file.replace('%', "%25").replace('#', "%23").replace('?', "%3F"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_lined_up_and_words_are_not() {
        let rows: Vec<Vec<String>> = [["a", "1.5 MB", "3 x"], ["b", "–", "x"], ["c", "−2", ""]]
            .map(|row| row.map(str::to_owned).to_vec())
            .to_vec();
        assert_eq!([0, 1, 2, 3].map(|column| is_number_column(&rows, column)), [false, true, false, false]);
        let html = table("", &["h".into()], &rows, &[], "", Some(2)).into_string();
        assert_eq!(html.matches("<td class=\"number\">").count(), 3);
        assert_eq!(html.matches("class=\"highlight\"").count(), 1);
    }

    #[test]
    fn addresses_stay_relative() {
        assert_eq!(address("maps/100%.png"), "./maps/100%25.png");
        assert_eq!(address("javascript:x"), "./javascript:x");
    }
}
