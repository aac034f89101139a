use anyhow::Context;
use clap::Args;
use kinoise::effects::{Active, CATALOGUE, Card, Parameter};
use serde_json::json;

use super::common::Global;
use super::console::{answer, next_step};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise effects target-bow vignetting
  kinoise effects --list")]
pub struct Arguments {
    /// Only these [default: all]
    #[arg(value_name = "ID")]
    ids: Vec<String>,
    /// Print the ids alone, one a line
    #[arg(long)]
    list: bool,
}

/// Width of a page of text, columns.
const MAX_COLUMNS: usize = 100;
const INDENT: &str = "    ";

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let cards = cards(&arguments.ids)?;
    if global.json {
        return global.print_json(&cards.iter().map(|card| as_json(card)).collect());
    }
    let page = |card: &&Card| if arguments.list { card.id.to_string() } else { page(card) };
    let pages: Vec<String> = cards.iter().map(page).collect();
    // The catalogue is the result, not a remark: it goes to stdout.
    answer(format!("{}\n", pages.join("\n")).as_bytes()).context("stdout")?;
    if let ([id], false) = (&arguments.ids[..], arguments.list) {
        let effect = Active::typical(id)?.argument();
        let to = format!("out/{id}");
        next_step(&["simulate".into(), to.into(), "--effect".into(), effect.into()]);
    }
    Ok(())
}

fn cards(ids: &[String]) -> anyhow::Result<Vec<&'static Card>> {
    if ids.is_empty() {
        return Ok(CATALOGUE.iter().map(|e| e.card()).collect());
    }
    let card = |id: &String| Active::typical(id).map(|a| a.effect.card());
    ids.iter().map(card).collect::<Result<_, _>>().context("effects")
}

fn page(card: &Card) -> String {
    let mut page = format!("{}\n", card.id);
    let shows = format!("shows in {}, over {}", describe(card.statistic), card.axis);
    let parameters = card
        .parameters
        .iter()
        .enumerate()
        .map(|(n, p)| parameter(p, (n == 0).then_some(card.identity)));
    let kinds: Vec<&str> = card.kinds.iter().map(|k| k.description()).collect();
    let lines = [card.summary.to_string(), shows].into_iter().chain(parameters).chain([
        format!("easily taken for: {}", card.confused_with),
        format!("happens to: {}", kinds.join(", ")),
        format!("source: {}", card.reference),
    ]);
    lines.for_each(|line| wrap(&line, &mut page));
    page
}

fn parameter(p: &Parameter, identity: Option<f64>) -> String {
    let unit = if p.unit().is_empty() { String::new() } else { format!(" {}", p.unit()) };
    let off = identity.map_or(String::new(), |value| format!(", off at {value}"));
    let [low, high] = p.range;
    format!("{} = {low} to {high}{unit}, typical {}{off}: {}", p.name, p.typical, p.summary)
}

fn describe(statistic: &str) -> &str {
    match statistic {
        "bias" => "the mean error",
        "variance" => "the size of the noise",
        "distribution" => "which values occur",
        "correlation" => "what errs together",
        "missing" => "pixels without depth",
        other => other,
    }
}

/// Appends `text` in lines of at most a page's width.
fn wrap(text: &str, page: &mut String) {
    let mut column = 0;
    for word in text.split_whitespace() {
        if column + 1 + word.len() > MAX_COLUMNS || column == 0 {
            page.push_str(if column == 0 { INDENT } else { "\n      " });
            column = INDENT.len() + 2;
        } else {
            page.push(' ');
            column += 1;
        }
        page.push_str(word);
        column += word.len();
    }
    page.push('\n');
}

fn as_json(card: &Card) -> serde_json::Value {
    let parameter = |p: &Parameter| json!({"name": p.name, "unit": p.unit(), "range": p.range, "typical": p.typical, "words": p.summary});
    json!({
        "id": card.id,
        "words": card.summary,
        "stage": card.stage,
        "statistic": card.statistic,
        "axis": card.axis,
        "parameters": card.parameters.iter().map(parameter).collect::<Vec<_>>(),
        "identity": {card.parameters[0].name: card.identity},
        "confused_with": card.confused_with,
        "reference": card.reference,
        "kinds": card.kinds,
    })
}
