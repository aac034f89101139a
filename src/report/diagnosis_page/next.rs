//! What to do next: the view to take and the commands to run.

use maud::{Markup, html};

use super::DiagnosisPage;
use super::cards::next_view;
use crate::diagnose::{Diagnosis, Verdict};
use crate::report::document::{list, section};

/// A command and its purpose.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    pub why: String,
    pub command: String,
}

pub(super) fn section_of(page: &DiagnosisPage<'_>) -> Markup {
    let inconclusive = page.diagnosis.verdict == Verdict::Inconclusive;
    let more = inconclusive.then(|| {
        html! {
            "Add views at other distances and tilts, in " code { "kinoise capture" } " or by hand, and diagnose again."
        }
    });
    let steps = page.steps.iter().map(|step| html! { (step.why) code { (step.command) } });
    section("What to do next", &list(view(page.diagnosis).into_iter().chain(more).chain(steps)))
}

/// The view that the first major finding with such a request asks for.
fn view(diagnosis: &Diagnosis) -> Option<Markup> {
    let asks = diagnosis.findings.iter().filter(|f| !f.minor).find_map(|f| f.next_view.as_ref());
    asks.map(next_view)
}
