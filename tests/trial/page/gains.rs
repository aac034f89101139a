//! What was gained on fresh views, method by method.

use maud::{Markup, PreEscaped, html};

use super::goals::learnt_where_it_matters;
use super::strips::Strips;
use super::words::ratio;
use crate::{Learnt, Proof, Ratio};
use kinoise::error::Result;
use kinoise::report::numbers::{ABSENT, fixed};

/// In this order; any other method after them.
pub(super) const ORDER: [&str; 7] = [
    "kinoise",
    "gaussian-process",
    "clams-grid",
    "polynomial",
    "sparse-regression",
    "symbolic-regression",
    "none",
];

pub(super) fn rank(method: &str) -> usize {
    ORDER.iter().position(|m| *m == method).unwrap_or(ORDER.len())
}

pub(super) fn section(proof: &Proof) -> Result<Markup> {
    let all: Vec<(String, Learnt)> =
        proof.scores.learnt.iter().map(|(k, v)| (k.clone(), v.clone())).collect();
    let strong = learnt_where_it_matters(proof);
    let figure = Strips::of(&proof.sets).map(|s| s.svg()).transpose()?;
    let caption = "Each dot a set whose causes are worth 50 nats or more each: the gain over the oracle’s, views like the recording’s (left) and \
                   views outside its distances and tilts (right). Boxes: quartiles and median; whiskers: 10th and 90th percentile. Dots beyond the ends \
                   are counted there.";
    Ok(html! {
        section {
            h2 { "What it is worth on fresh views" }
            @if all.is_empty() { p { "No set has views to examine what was learnt." } } @else {
                p {
                    "Every method learns from the same recording; then it predicts views that nobody gave it. Its gain is the expected log score beyond that of \
                     the model file alone, as a share of what the " b { "oracle" } " gains, who knows the hidden cause: 1 is all there is to gain, 0 is nothing, and \
                     below 0 the method does harm. Sets whose oracle gains next to nothing have no ratio."
                }
                h3 { "Sets whose causes are worth 50 nats or more each (those of the endpoints)" }
                (table(&strong))
                h3 { "All sets with an oracle" }
                (table(&all))
                @if let Some(figure) = figure { figure {
                    div.wide role="img" aria-label=(caption) { (PreEscaped(figure)) }
                    figcaption { (caption) }
                } }
            }
        }
    })
}

fn table(learnt: &[(String, Learnt)]) -> Markup {
    let mut rows: Vec<&(String, Learnt)> = learnt.iter().collect();
    rows.sort_by_key(|r| rank(&r.0));
    html! {
        div.wide { table {
            thead {
                tr { th {} th.n colspan="3" { "views like the recording’s" } th.n colspan="3" { "views outside it" } th {} }
                tr { th { "Method" } @for _ in 0..2 { th.n { "sets" } th.n { "median" } th.n { "10th percentile" } } th.n { "Parameters, median" } }
            }
            tbody {
                @for (name, l) in rows { tr.ours[name == "kinoise"] {
                    th scope="row" { (name) }
                    (three(l.within))
                    (three(l.beyond))
                    td.n { (l.parameters.map_or(ABSENT.into(), |p| fixed(p, 0))) }
                } }
                tr { th scope="row" { "oracle" } @for _ in 0..2 { td {} td.n { "1" } td.n { "1" } } td.n { (ABSENT) } }
            }
        } }
    }
}

fn three(found: Option<Ratio>) -> Markup {
    html! { @match found {
        Some(r) => { td.n { (r.n) } td.n { (ratio(r.median)) } td.n { (ratio(r.low)) } },
        None => { td.n { "0" } td.n { (ABSENT) } td.n { (ABSENT) } },
    } }
}
