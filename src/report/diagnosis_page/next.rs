//! What to do now: the view to take, or the command to run.

use maud::{Markup, html};

use super::DiagnosisPage;
use super::cards::next_view;
use crate::diagnose::{Diagnosis, Reference, Status, Verdict};
use crate::report::document::{list, section};
use crate::terms::Statistic;

pub(super) fn section_of(page: &DiagnosisPage<'_>) -> Markup {
    let diagnosis = page.diagnosis;
    let steps: Vec<Markup> = match diagnosis.verdict {
        Verdict::Match => vec![
            html! { "Use the model: " (command(&format!("kinoise map SEQUENCE --model {} -o map", model(page)))) },
        ],
        Verdict::Inconclusive => {
            let more = html! {
                "Add views at other distances and tilts, in " (command("kinoise capture")) " or by hand, and diagnose again."
            };
            view(diagnosis).into_iter().chain([more]).collect()
        }
        Verdict::Mismatch => mismatch(page),
    };
    section("What to do next", &list(steps))
}

fn mismatch(page: &DiagnosisPage<'_>) -> Vec<Markup> {
    let (diagnosis, recording, model) = (page.diagnosis, recording(page), model(page));
    let has = |f: fn(&crate::diagnose::Finding) -> bool| diagnosis.findings.iter().any(f);
    let gains = diagnosis.heldout.as_ref().is_some_and(|h| h.gain_interval[0] > 0.0);
    let biased = has(|f| f.statistic == Statistic::Bias && f.status != Status::NotIdentifiable);
    let mut steps: Vec<Markup> = view(diagnosis).into_iter().collect();
    if has(|f| f.status == Status::Recalibrate) {
        let calibrate = format!("kinoise calibrate {recording} -o calibrated");
        steps.push(
            html! { "The parameters of the noise are off; fit them again: " (command(&calibrate)) },
        );
    }
    match diagnosis.reference {
        Reference::SimulatedRecording => {
            let simulate = format!("kinoise simulate again --like {recording} --model {model}");
            steps.push(
                html! { "Simulate the same views with what was found: " (command(&simulate)) },
            );
        }
        Reference::Model if biased && gains => {
            let correct = format!("kinoise correct {recording} --model {model} -o corrected");
            steps.push(html! { "Take the errors out of the depth: " (command(&correct)) });
        }
        Reference::Model => {
            steps.push(html! { "Map with the extended model: " (command(&format!("kinoise map SEQUENCE --model {model} -o map"))) });
        }
    }
    steps
}

/// The one that the largest finding asks for.
fn view(diagnosis: &Diagnosis) -> Option<Markup> {
    let asks = diagnosis.findings.iter().filter(|f| !f.minor).find_map(|f| f.next_view.as_ref());
    asks.map(next_view)
}

fn command(text: &str) -> Markup {
    html! { code { (text) } }
}

fn recording<'a>(page: &DiagnosisPage<'a>) -> &'a str {
    if page.origin.recording.is_empty() { "RECORDING" } else { &page.origin.recording }
}

/// The extended model, beside this page.
fn model(page: &DiagnosisPage<'_>) -> String {
    match page.origin.folder.as_str() {
        "" => "model.json".into(),
        folder => format!("{folder}/model.json"),
    }
}
