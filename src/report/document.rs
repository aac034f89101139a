//! The skeleton of a page, one self-contained HTML document, and the building blocks shared by all pages.
//!
//! A page loads nothing from outside; its content security policy makes the browser enforce that.

use std::time::SystemTime;

use base64::prelude::{BASE64_STANDARD, Engine};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::chart::Chart;
use crate::error::Result;
use crate::model::Provenance;

/// Style sheet of all pages.
const STYLE: &str = include_str!("page.css");
/// Sorts tables, shows tips, enlarges pictures. A page is readable without it.
const SCRIPT: &str = include_str!("page.js");
/// Content security policy: a page may load only what it carries.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; \
    img-src data:; base-uri 'none'; form-action 'none'";

/// What is needed to make a page again.
#[derive(Debug, Clone, Default)]
pub struct Origin {
    /// The recording as it was given.
    pub recording: String,
    /// The command line, without options that do not affect results.
    pub command: String,
    pub seed: Option<u64>,
    /// Creation time, RFC 3339, UTC.
    pub created: String,
}

impl Origin {
    /// Origin with the given creation time, or the current time for `None`.
    pub fn at(recording: &str, command: &str, seed: Option<u64>, time: Option<SystemTime>) -> Self {
        let made = Provenance::at(seed, time.unwrap_or_else(SystemTime::now));
        let [recording, command] = [recording, command].map(String::from);
        Origin { recording, command, seed, created: made.created }
    }
}

/// Assembles the whole document. The origin is its last section; `more` adds rows to it.
pub fn document(title: &str, origin: &Origin, more: &[(String, Markup)], body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main { (body) (footer(origin, more)) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
}

fn footer(origin: &Origin, more: &[(String, Markup)]) -> Markup {
    let version = format!("kinoise {}", env!("CARGO_PKG_VERSION"));
    let mut all = vec![
        ("made by".to_string(), html! { (version) }),
        ("on".into(), html! { (origin.created) }),
        ("recording".into(), html! { (origin.recording) }),
        ("command".into(), html! { code { (origin.command) } }),
    ];
    all.extend(origin.seed.map(|seed| ("seed".into(), html! { (seed) })));
    all.retain(|(_, value)| !matches!(value.0.as_str(), "" | "<code></code>"));
    all.extend(more.iter().cloned());
    html! { footer { (section("How this page was made", &facts(all))) } }
}

/// A section of a page under a linkable heading.
pub fn section(title: &str, content: &Markup) -> Markup {
    html! { section { (heading(2, title)) (content) } }
}

/// A heading with an id made from its words and a link to itself.
pub fn heading(level: u8, title: &str) -> Markup {
    let id = slug(title);
    let inner =
        html! { (title) " " a.anchor href={ "#" (id) } aria-label={ "link to " (title) } { "#" } };
    html! { @if level == 2 { h2 id=(id) { (inner) } } @else { h3 id=(id) { (inner) } } }
}

/// The title's words in lower case, joined by hyphens.
pub(super) fn slug(title: &str) -> String {
    let words = title.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_lowercase).collect::<Vec<_>>().join("-")
}

/// The key numbers of a page: label, number, remark.
pub fn tiles<'a>(tiles: impl IntoIterator<Item = (&'a str, String, String)>) -> Markup {
    html! { div.tiles { @for (what, value, remark) in tiles {
        div { p.label { (what) } p.big { (value) } p.label { (remark) } }
    } } }
}

/// The page's answer, shown first. `class` sets its tone: `good`, `bad` or `unsure`.
pub fn answer(class: &str, mark: &str, sentence: &str, more: &Markup) -> Markup {
    html! { section.answer.(class) { p.mark { (mark) } p.sentence { (sentence) } (more) } }
}

/// A sentence with `commands` between backticks and squares written as `z^2`.
pub fn prose(text: &str) -> Markup {
    let text = text.replace("^2", "²");
    html! { @for (i, part) in text.split('`').enumerate() {
        @if i % 2 == 1 { code { (part) } } @else { (part) }
    } }
}

/// The cells of a table row; each cell is anything that maud can render.
macro_rules! row {
    ($($cell:expr),* $(,)?) => { vec![$(maud::html! { ($cell) }),*] };
}
pub(super) use row;

/// Most columns of a table whose cells stack on a phone; wider tables scroll, so that rows stay comparable.
const MAX_STACKED: usize = 8;

/// A table with the given column titles. Where the page is too narrow, the cells of a row stack under
/// its name, each with its title; tables of up to three or of many columns scroll instead.
///
/// The first column names the row. A title prefixed with `>` marks a column of numbers, aligned right;
/// `~` marks a column of sentences, set small.
pub fn table<C: AsRef<str>>(columns: &[C], rows: impl IntoIterator<Item = Vec<Markup>>) -> Markup {
    let columns: Vec<(Option<&str>, &str)> = columns.iter().map(|c| set(c.as_ref())).collect();
    let class = match columns.len() {
        0..=3 => None,
        4..=MAX_STACKED => Some("stack"),
        _ => Some("small"),
    };
    html! {
        div.wide tabindex="0" { table class=[class] {
            thead { tr { @for (class, title) in &columns { th class=[class] { (title) } } } }
            tbody { @for cells in rows { tr {
                @for (i, ((class, title), cell)) in columns.iter().zip(cells).enumerate() {
                    @if i == 0 { th class=[class] { (cell) } } @else { td class=[class] data-label=(title) { (cell) } }
                }
            } } }
        } }
    }
}

/// A column's title, as in [`table`], and its cell for a given row.
pub(super) type Column<'a, T> = (&'a str, &'a dyn Fn(&T) -> Markup);

/// A table with one row per item.
pub(super) fn table_of<T>(columns: &[Column<'_, T>], things: &[T]) -> Markup {
    let titles: Vec<&str> = columns.iter().map(|(title, _)| *title).collect();
    let cells = |thing| columns.iter().map(|(_, cell)| cell(thing)).collect();
    table(&titles, things.iter().map(cells))
}

/// CSS class and title of a column.
fn set(column: &str) -> (Option<&'static str>, &str) {
    match (column.strip_prefix('>'), column.strip_prefix('~')) {
        (Some(title), _) => (Some("n"), title),
        (_, Some(title)) => (Some("words"), title),
        _ => (None, column),
    }
}

/// A definition list of names and values.
pub fn facts<N: AsRef<str>>(facts: impl IntoIterator<Item = (N, Markup)>) -> Markup {
    html! {
        dl { @for (name, value) in facts { div { dt { (name.as_ref()) } dd { (value) } } } }
    }
}

/// A list; nothing if there are no items.
pub(super) fn list(items: impl IntoIterator<Item = Markup>) -> Markup {
    let mut items = items.into_iter().peekable();
    html! { @if items.peek().is_some() { ul { @for item in items { li { (item) } } } } }
}

/// A section that opens on a click, or is `open` from the start.
pub fn fold(title: &str, open: bool, content: &Markup) -> Markup {
    html! { details open[open] { summary { (title) } (content) } }
}

/// A chart with its caption; with an empty one its title is all. It is drawn wide and narrow; the style sheet
/// shows the one that fits.
pub fn figure(chart: &Chart, caption: &str) -> Result<Markup> {
    let label = if chart.title.is_empty() { caption } else { &chart.title };
    let drawing = drawing(chart, label)?;
    Ok(html! { figure { (drawing) @if !caption.is_empty() { figcaption { (caption) } } } })
}

/// Charts with their titles, side by side where there is room.
pub(super) fn beside(charts: &[Chart]) -> Result<Markup> {
    let figures = charts.iter().map(|chart| figure(chart, ""));
    let figures = figures.collect::<Result<Vec<Markup>>>()?;
    Ok(html! { div.beside { @for figure in figures { (figure) } } })
}

/// A chart without a caption.
pub(super) fn drawing(chart: &Chart, label: &str) -> Result<Markup> {
    let narrow = chart.narrow().map(|c| c.svg()).transpose()?;
    let broad = chart.svg()?;
    Ok(html! {
        div.chart role="img" aria-label=(label) {
            div.broad[narrow.is_some()] { (PreEscaped(broad)) }
            @if let Some(svg) = narrow { div.narrow { (PreEscaped(svg)) } }
        }
    })
}

/// An `img` with embedded pixels, enlarged on a click.
pub(super) fn picture(png: &[u8], [width, height]: [usize; 2], alt: &str) -> Markup {
    let source = format!("data:image/png;base64,{}", BASE64_STANDARD.encode(png));
    html! { button.zoom type="button" title="enlarge" {
        img alt=(alt) width=(width) height=(height) src=(source);
    } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_says_where_it_comes_from_and_loads_nothing() {
        let time = SystemTime::UNIX_EPOCH;
        let origin = Origin::at("a <b>", "kinoise map a", Some(7), Some(time));
        let page = document("t", &origin, &[], &section("σ & tilt", &html! {})).into_string();
        for says in
            ["a &lt;b&gt;", "<code>kinoise map a</code>", "1970-01-01T00:00:00Z", "<dd>7</dd>"]
        {
            assert!(page.contains(says), "{says}");
        }
        assert!(page.contains(r##"<h2 id="σ-tilt">"##) && page.contains("default-src 'none'"));
        let bare = document("t", &Origin::default(), &[], &html! {}).into_string();
        assert!(!bare.contains("command"), "what is not known is not said");
        assert_eq!(prose("run `a <b>` now").into_string(), "run <code>a &lt;b&gt;</code> now");
        assert_eq!(prose("with z^2").into_string(), "with z²");
    }

    #[test]
    fn a_table_is_escaped_and_set_by_column() {
        let table = table(&["view", ">z m"], [row!["<b>", 2.5]]).into_string();
        assert!(
            table.contains(r#"<th>&lt;b&gt;</th><td class="n" data-label="z m">2.5</td>"#),
            "{table}"
        );
    }
}
