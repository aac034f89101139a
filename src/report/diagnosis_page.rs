//! The page of a diagnosis: the answer for everybody on the first screen, the evidence below.

mod advice;
mod curve;
mod evidence;
mod findings;
mod names;
mod outcome;
mod parameters;
mod pictures;
mod verdict;
mod words;

use maud::{Markup, html};

pub use pictures::Picture;

use super::document::{Kind, document};
use crate::diagnose::{Diagnosis, Reference, Verdict};
use crate::error::Result;

const KIND: Kind = Kind { class: "diagnosis", style: include_str!("diagnosis_page.css") };

/// What the page is about.
#[derive(Debug, Clone, Copy)]
pub struct DiagnosisPage<'a> {
    /// Of the page.
    pub title: &'a str,
    /// All that it tells.
    pub diagnosis: &'a Diagnosis,
    /// Views whose residuals are worth seeing; few, they are large.
    pub pictures: &'a [Picture],
}

/// The page as text: one self-contained file, no scripts.
///
/// # Errors
/// When a picture cannot be drawn.
pub fn diagnosis_page(page: &DiagnosisPage<'_>) -> Result<String> {
    let diagnosis = page.diagnosis;
    let body = html! {
        (heading(page))
        (verdict::section(diagnosis))
        @if diagnosis.verdict == Verdict::Inconclusive { (evidence::remarks(&diagnosis.remarks)) }
        (findings::section(&diagnosis.findings)?)
        @if diagnosis.verdict == Verdict::Match { (nothing_found(diagnosis)) }
        (outcome::gained_and_left(diagnosis))
        (pictures::section(page.pictures)?)
        (proof(diagnosis))
    };
    Ok(document(page.title, Some(KIND), &body).into_string())
}

fn heading(page: &DiagnosisPage<'_>) -> Markup {
    let diagnosis = page.diagnosis;
    html! {
        header {
            h1 { (page.title) }
            p.sub {
                "Recording " b { (diagnosis.recording) } ", held against "
                @match diagnosis.reference {
                    Reference::Model => "the noise model calibrated for the sensor, here called the simulation",
                    Reference::SimulatedRecording => "a simulated recording of the same scene",
                }
                "."
            }
        }
    }
}

/// What it is worth that nothing was found.
fn nothing_found(diagnosis: &Diagnosis) -> Markup {
    html! {
        (outcome::looked_for(diagnosis))
        (outcome::detectable(&diagnosis.detectable))
        (outcome::cannot_tell(&diagnosis.cannot_tell))
    }
}

fn proof(diagnosis: &Diagnosis) -> Markup {
    html! {
        h1.evidence { "The evidence" }
        (evidence::map(&diagnosis.map))
        (evidence::alternatives(&diagnosis.findings))
        (evidence::parameters(&diagnosis.findings))
        (evidence::held_out(diagnosis.heldout.as_ref()))
        (evidence::after(diagnosis))
        @if diagnosis.verdict != Verdict::Match {
            (outcome::detectable(&diagnosis.detectable))
            (outcome::cannot_tell(&diagnosis.cannot_tell))
        }
        (evidence::views(&diagnosis.views))
        @if diagnosis.verdict != Verdict::Inconclusive { (evidence::remarks(&diagnosis.remarks)) }
        p.note {
            "The same as data: diagnosis.json. σ is the standard deviation of a single reading that the simulation \
             expects; sizes in mm are root mean squares over the recording. A p-value is the chance of a difference this large if the simulation were right."
        }
    }
}

#[cfg(test)]
mod tests;
