//! The frame of a page: one self-contained HTML document without scripts.

use maud::{DOCTYPE, Markup, PreEscaped, html};

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
