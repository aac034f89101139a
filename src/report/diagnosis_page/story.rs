//! A diagnosis in a few sentences, for the page's first screen and the terminal.

use super::parameters::brief;
use super::sentences::{called, capital, join, mm};
use crate::capture::far_side;
use crate::diagnose::{Diagnosis, Finding, HeldOut, NextView, Status, Verdict};
use crate::report::numbers::{count, fixed, nats};
use crate::terms::{Basis, Statistic};

/// Most findings with a sentence each. With the verdict, the remaining findings, the gain and what is left
/// that makes seven sentences.
const MAX_SENTENCES: usize = 3;

/// Tells the largest findings in a sentence each, all others in one, the gain on the held-out views, and what
/// the same tests find against the extended model: at most six sentences after the verdict.
pub fn story(diagnosis: &Diagnosis) -> Vec<String> {
    if diagnosis.verdict != Verdict::Mismatch {
        let unsettled = diagnosis.verdict == Verdict::Inconclusive;
        return diagnosis.remarks.iter().take(usize::from(unsettled)).cloned().collect();
    }
    let found = diagnosis.findings.iter().filter(|f| f.status != Status::NotIdentifiable);
    let (main, minor): (Vec<&Finding>, Vec<&Finding>) = found.partition(|f| !f.minor);
    let (told, more) = main.split_at(main.len().min(MAX_SENTENCES));
    let mut sentences: Vec<String> = told.iter().map(|f| of(f)).collect();
    sentences.extend(rest(more, &minor));
    sentences.extend(gained(diagnosis));
    sentences.extend(left(diagnosis));
    sentences
}

/// One finding: what, size, share of the mismatch, parameters, and doubts.
fn of(f: &Finding) -> String {
    let smooth = |b: &Basis| matches!(b, Basis::Spline { .. } | Basis::Map { .. });
    let and_rest = f.effect.is_some() && f.terms.iter().any(|t| smooth(&t.basis));
    let rest = match &f.shape {
        _ if and_rest => " and a smooth rest of it that no formula follows".to_string(),
        Some(shape) if f.status == Status::Unexplained && f.contradicted.is_none() => {
            format!(" ({shape})")
        }
        _ => String::new(),
    };
    // The shape of a finding in some views already tells in which.
    let which = f.which_views().filter(|_| rest.is_empty());
    let which = which.map_or_else(String::new, |which| format!(", {which}"));
    let size = match f.statistic {
        Statistic::Dropout => match fixed(100.0 * f.size.sigma, 1) {
            few if few == "0.0" => Some("less than 0.1 % of the pixels lost".to_string()),
            percent => Some(format!("{percent} % of the pixels lost")),
        },
        // A motion has a speed but no size.
        _ if f.size.mm == 0.0 && f.size.sigma == 0.0 => None,
        _ => {
            let sigmas = match fixed(f.size.sigma, 2) {
                little if little == "0.00" => "less than 0.01".to_string(),
                sigmas => sigmas,
            };
            Some(format!("{} rms, {sigmas} of the noise", mm(f.size.mm)))
        }
    };
    let parameter = |(name, value): (&String, &serde_json::Value)| brief(f.effect, name, value);
    let known = f.parameters.iter().filter_map(parameter).collect::<Vec<_>>().join(", ");
    let parameters = if known.is_empty() { known } else { format!(" ({known})") };
    let differ = "; the two halves of the views do not agree on it";
    let halves = if f.replicated == Some(false) { differ } else { "" };
    let next = f.next_view.as_ref().map_or_else(String::new, settled_by);
    let (name, share) = (capital(&called(f)), fixed(100.0 * f.share, 0));
    let law = f.is_law().then(|| "by the reference distances".to_string());
    let share = law.unwrap_or_else(|| format!("{share} % of the mismatch"));
    let sizes: Vec<String> = size.into_iter().chain([share]).collect();
    format!("{name}{rest}{which}: {}{parameters}{halves}{next}.", sizes.join(", "))
}

fn settled_by(view: &NextView) -> String {
    let pose = match fixed(view.theta_rad.to_degrees(), 0) {
        tilt if tilt == "0" => "facing the sensor".to_string(),
        tilt => format!("tilted by {tilt}°, {} side away", far_side(view.azimuth_rad)),
    };
    let helps = match view.is_likely_to_settle() {
        true => format!("would settle it with a chance of {} %", fixed(100.0 * view.chance, 0)),
        false => "would help most, but is not likely to settle it".to_string(),
    };
    format!("; a view at {} m {pose} {helps}", fixed(view.z_m, 2))
}

/// Summarises the findings without a sentence of their own.
fn rest(more: &[&Finding], minor: &[&Finding]) -> Option<String> {
    let share = |all: &[&Finding]| all.iter().map(|f| f.share).sum::<f64>();
    let names = |all: &[&Finding]| {
        let named = all.iter().filter(|f| f.effect.is_some()).map(|f| called(f));
        let unnamed = match all.iter().filter(|f| f.effect.is_none()).count() {
            0 => None,
            1 => Some("one without a name".into()),
            n => Some(format!("{n} without a name")),
        };
        join(&named.chain(unnamed).collect::<Vec<_>>(), "and")
    };
    let more = (!more.is_empty()).then(|| {
        let called = join(&more.iter().map(|f| called(f)).collect::<Vec<_>>(), "and");
        let together = if more.len() > 1 { " together" } else { "" };
        format!("{called}, {} % of it{together}", fixed(100.0 * share(more), 0))
    });
    let minor = (!minor.is_empty()).then(|| {
        format!("small remains ({}), {} of it together", names(minor), small_percent(share(minor)))
    });
    let parts: Vec<String> = more.into_iter().chain(minor).collect();
    (!parts.is_empty()).then(|| capital(&parts.join("; ")) + ".")
}

fn small_percent(share: f64) -> String {
    match 100.0 * share {
        p if p < 0.1 => "less than 0.1 %".into(),
        p => format!("{} %", fixed(p, 1)),
    }
}

/// RMS on the held-out views before and after; `None` if both print alike, as when only noise was found.
pub(super) fn smooth_residual(h: &HeldOut) -> Option<[String; 2]> {
    let [before, after] = [h.rms_mm_before, h.rms_mm_after].map(mm);
    (before != after).then_some([before, after])
}

pub(super) fn gained(diagnosis: &Diagnosis) -> Option<String> {
    // Without a finding nothing can be gained.
    let h = diagnosis.heldout.as_ref().filter(|_| diagnosis.verdict != Verdict::Match)?;
    let aside = count(h.views.len(), "view");
    if h.is_nothing() {
        return (!diagnosis.has_no_score()).then(|| {
            format!("On {aside} kept aside nothing is gained: without them the same search finds nothing.")
        });
    }
    let [low, high] = h.gain_interval;
    let (what, all) = if h.gain < 0.0 {
        ("lost", [-h.gain, -high, -low])
    } else {
        ("gained", [h.gain, low, high])
    };
    let [by, low, high] = nats(all);
    let mut gained = vec![format!("{by} nats a view are {what} [{low}, {high}]")];
    if let Some([before, after]) = smooth_residual(h) {
        gained.insert(0, format!("the smooth residual goes from {before} to {after}"));
    }
    let correction = [h.correction_rms_before_px, h.correction_rms_after_px].map(|v| fixed(v, 3));
    let alone = match &correction {
        [before, after] if before == after => String::new(),
        [before, after] => {
            format!("; `kinoise correct` alone takes every pixel from {before} to {after} px rms")
        }
    };
    Some(format!("On {aside} kept aside {}{alone}.", gained.join(" and ")))
}

fn left(diagnosis: &Diagnosis) -> Option<String> {
    let after = &diagnosis.after;
    let share: f64 = after.remaining.iter().map(|r| r.share).sum();
    Some(match (after.verdict, after.remaining.len()) {
        (Verdict::Match, _) => "The same tests find nothing more in the extended model.".into(),
        (Verdict::Inconclusive, _) => "What the extended model leaves could not be tested.".into(),
        (Verdict::Mismatch, 0) => {
            "The same tests still find a mismatch beside the extended model.".into()
        }
        (Verdict::Mismatch, n) => format!(
            "The same tests still find {} beside the extended model, {} of what was explained.",
            count(n, "difference"),
            small_percent(share)
        ),
    })
}
