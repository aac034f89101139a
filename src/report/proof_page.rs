//! The page of a trial, for somebody who does not believe it: what was asked, what fell short, the
//! figures, every failure, and how to check all of it.

mod advice;
mod certainty;
mod failures;
mod gains;
mod goal;
mod goals;
mod how;
mod matrix;
mod multiples;
mod power;
mod rates;
mod sketch;
mod strips;
mod summary;
mod words;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::error::Result;
use crate::prove::{KeptCurve, Proof, ProvenSet};

/// What the page is about.
pub struct ProofPage<'a> {
    /// Of the page.
    pub title: &'a str,
    /// All that it tells.
    pub proof: &'a Proof,
    /// The curve of the first finding of a set, where one is kept.
    pub curve: &'a dyn Fn(&ProvenSet) -> Option<KeptCurve>,
}

/// The page as text: one self-contained file, no scripts.
///
/// # Errors
/// When a picture cannot be drawn.
pub fn proof_page(page: &ProofPage<'_>) -> Result<String> {
    let proof = page.proof;
    let body = html! {
        header { h1 { (page.title) } }
        (summary::section(proof))
        (power::section(proof)?)
        (matrix::section(&proof.sets))
        (certainty::section(&proof.scores)?)
        (advice::section(proof))
        (rates::section(&proof.scores))
        (gains::section(proof)?)
        (failures::section(proof, page.curve))
        (how::section(proof))
    };
    Ok(skeleton(page.title, &body).into_string())
}

fn skeleton(title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(include_str!("page.css"))) (PreEscaped(include_str!("proof_page.css"))) }
            }
            body.proof { main { (body) } }
        }
    }
}

#[cfg(test)]
mod tests;
