//! How the model was made, so that it can be made again.

use maud::{Markup, html};
use serde_json::{Map, Value};

use crate::model::Provenance;

pub(super) fn section(provenance: &Provenance) -> Markup {
    html! {
        section {
            h2 { "How it was made" }
            dl {
                (fact("made by", &format!("{} {}", provenance.tool, provenance.version)))
                (fact("on", &provenance.created))
                @if let Some(seed) = provenance.seed { (fact("seed", &seed.to_string())) }
                (facts("", &provenance.options))
                (facts("SHA-256 of ", &provenance.sha256))
            }
        }
    }
}

fn facts(before: &str, map: &Map<String, Value>) -> Markup {
    html! {
        @for (name, value) in map {
            (fact(&format!("{before}{}", name.replace('_', " ")), &words(value)))
        }
    }
}

fn fact(name: &str, value: &str) -> Markup {
    html! { div { dt { (name) } dd { (value) } } }
}

fn words(value: &Value) -> String {
    match value {
        Value::Null => "automatic".into(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
