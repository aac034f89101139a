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

use maud::html;

use crate::{KeptCurve, Proof, ProvenSet};
use kinoise::error::Result;
use kinoise::report::document::{Kind, document};

const KIND: Kind = Kind { class: "proof", style: include_str!("page.css") };

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
    Ok(document(page.title, Some(KIND), &body).into_string())
}

#[cfg(test)]
mod tests;
