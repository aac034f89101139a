//! The skeleton of a page: one self-contained HTML document without scripts, and the parts that
//! all pages are made of.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::chart::Chart;
use crate::error::Result;

/// How all pages look.
const STYLE: &str = include_str!("page.css");

/// What one kind of page adds to the style of all.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    /// Class of the body.
    pub class: &'static str,
    pub style: &'static str,
}

/// The whole document; `kind` where the style of all pages is not enough.
pub fn document(title: &str, kind: Option<Kind>, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) @if let Some(kind) = kind { (PreEscaped(kind.style)) } }
            }
            body class=[kind.map(|k| k.class)] { main { (body) } }
        }
    }
}

/// The cells of a row, each anything that maud can render.
macro_rules! row {
    ($($cell:expr),* $(,)?) => { vec![$(maud::html! { ($cell) }),*] };
}
pub(super) use row;

/// A table by the titles of its columns, which scrolls by itself where the page is too narrow.
///
/// The first column names the row. A title after `>` is that of a column of numbers, set to the
/// right; one after `~` is that of a column of sentences, set small.
pub fn table<C: AsRef<str>>(columns: &[C], rows: impl IntoIterator<Item = Vec<Markup>>) -> Markup {
    let columns: Vec<(Option<&str>, &str)> = columns.iter().map(|c| set(c.as_ref())).collect();
    html! {
        div.wide { table class=[(columns.len() > 8).then_some("small")] {
            thead { tr { @for (class, title) in &columns { th class=[class] { (title) } } } }
            tbody { @for cells in rows { tr {
                @for (i, ((class, _), cell)) in columns.iter().zip(cells).enumerate() {
                    @if i == 0 { th class=[class] { (cell) } } @else { td class=[class] { (cell) } }
                }
            } } }
        } }
    }
}

/// A column's title, as of [`table`], and its cell in a row.
pub(super) type Column<'a, T> = (&'a str, &'a dyn Fn(&T) -> Markup);

/// A table with a row for each of some things.
pub(super) fn table_of<T>(columns: &[Column<'_, T>], things: &[T]) -> Markup {
    let titles: Vec<&str> = columns.iter().map(|(title, _)| *title).collect();
    let cells = |thing| columns.iter().map(|(_, cell)| cell(thing)).collect();
    table(&titles, things.iter().map(cells))
}

/// Class and title of a column.
fn set(column: &str) -> (Option<&'static str>, &str) {
    match (column.strip_prefix('>'), column.strip_prefix('~')) {
        (Some(title), _) => (Some("n"), title),
        (_, Some(title)) => (Some("words"), title),
        _ => (None, column),
    }
}

/// Names and what they are.
pub fn facts<N: AsRef<str>>(facts: impl IntoIterator<Item = (N, Markup)>) -> Markup {
    html! {
        dl { @for (name, value) in facts { div { dt { (name.as_ref()) } dd { (value) } } } }
    }
}

/// A list; nothing where there are no items.
pub(super) fn list(items: impl IntoIterator<Item = Markup>) -> Markup {
    let mut items = items.into_iter().peekable();
    html! { @if items.peek().is_some() { ul { @for item in items { li { (item) } } } } }
}

/// What opens on a click; open from the start where it is short.
pub(super) fn fold(title: &str, open: bool, content: &Markup) -> Markup {
    html! { details open[open] { summary { (title) } (content) } }
}

/// A chart with its caption.
///
/// # Errors
/// When the chart cannot be drawn.
pub(super) fn figure(chart: &Chart, caption: &str) -> Result<Markup> {
    let svg = chart.svg()?;
    Ok(html! {
        figure {
            div.wide role="img" aria-label=(caption) { (PreEscaped(svg)) }
            figcaption { (caption) }
        }
    })
}

/// An `img` that carries its pixels.
pub(super) fn picture(png: &[u8], [width, height]: [usize; 2], alt: &str) -> Markup {
    let source = format!("data:image/png;base64,{}", base64(png));
    html! { img alt=(alt) width=(width) height=(height) src=(source); }
}

/// Base64 (RFC 4648).
pub(super) fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = (0..3).fold(0u32, |w, i| w << 8 | u32::from(*chunk.get(i).unwrap_or(&0)));
        for i in 0..4 {
            let sextet = (word >> (18 - 6 * i)) & 0x3f;
            text.push(if i <= chunk.len() { char::from(ALPHABET[sextet as usize]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 4648, section 10.
    #[test]
    fn base64_of_the_standard() {
        for (plain, coded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64(&[0xff, 0xfb, 0xf0]), "//vw");
    }

    #[test]
    fn a_table_is_escaped_and_set_by_column() {
        let table = table(&["view", ">z m"], [row!["<b>", 2.5]]).into_string();
        assert!(table.contains(r#"<th>&lt;b&gt;</th><td class="n">2.5</td>"#), "{table}");
    }
}
