//! Final results: the verdict, the ranked findings, the extended model.

use std::collections::BTreeSet;

use super::diagnosis::{CannotTell, Diagnosis, Finding, HeldOut, Status, Verdict};
use super::distance::reference::can_happen;
use super::finding::naming::unname;
use super::finding::other_findings::named;
use super::search::outcome::Outcome;
use super::views::field::Field;
use super::views::tiles::SIDE;
use crate::effects;
use crate::model::{Covariance, Effect, NoiseModel, UNEXPLAINED};
use crate::sensors::SensorKind;
use crate::terms::{Axis, Statistic};
use crate::view::{RecordingFile, Sensor};

pub(super) fn not_identifiable(what: &CannotTell) -> Finding {
    Finding {
        status: Status::NotIdentifiable,
        alternatives: Vec::new(),
        physics: what.why.clone(),
        ..named(what.effect, Statistic::Bias, Axis::Z)
    }
}

/// Removes names and alternatives that cannot occur on a camera of this kind.
pub(super) fn forget_impossible(found: &mut [Finding], kind: Option<SensorKind>) {
    for f in found {
        f.alternatives.retain(|a| can_happen(a.effect, kind));
        if f.effect.is_some_and(|id| !can_happen(id, kind)) {
            unname(f);
        }
    }
}

/// Keeps each name once: for the strongest finding of all views, which the model holds, or else for the
/// strongest of some views.
pub(super) fn merge(found: &mut Vec<Finding>) {
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    let of_all: BTreeSet<&str> =
        found.iter().filter(|f| f.of_some.is_none()).filter_map(|f| f.effect).collect();
    let mut names = BTreeSet::new();
    found.retain(|f| {
        let told = |id| f.of_some.is_some() && of_all.contains(id);
        f.effect.is_none_or(|id| !told(id) && names.insert(id))
    });
}

/// Probability that a symptom's name is the cause, by Jeffreys's prior: none of ten such names on
/// development seeds (501, 777, 902) was.
const NO_SYMPTOM: f64 = 0.045;
/// Effects that change how noise arises, and so its size.
const MAKES_NOISE: [&str; 3] = ["spatial-correlation", "frozen-noise", "disparity-quantisation"];
/// Share of the noise's standard deviation from which on such a change is reported first.
const LARGE: f64 = 0.3;

/// Downgrades symptoms where a recording is compared with a simulation: the size of the noise follows from its
/// origin. Where the simulation is `matched` as a sensor is, what the catalogue calls a cause is often a symptom,
/// too; in a simulation by formulas it is a formula like theirs.
pub(super) fn symptoms(found: &mut [Finding], matched: bool) {
    let is_symptom = |id: &str| matched && effects::find(id).is_some_and(|e| e.card().is_symptom);
    let moves = found.iter().any(|f| f.effect == Some("target-motion"));
    let made = moves
        || found
            .iter()
            .any(|f| f.size.sigma > LARGE && f.effect.is_some_and(|id| MAKES_NOISE.contains(&id)));
    for f in found.iter_mut() {
        let symptom = f.effect.is_some_and(is_symptom);
        for a in f.alternatives.iter_mut().filter(|a| is_symptom(a.effect)) {
            a.probability = a.probability.map(|p| NO_SYMPTOM * p);
        }
        // A target that moves past the pattern is matched anew in every frame.
        let renewed = moves && matches!(f.effect, Some("temporal-correlation" | "frame-jitter"));
        if symptom {
            f.physics.push_str(" Held against a simulation it may be a symptom: light, blur and window change it too.");
        }
        let nameless =
            f.effect.is_none() && matches!(f.statistic, Statistic::Variance | Statistic::Dropout);
        if renewed || made && (symptom || nameless || f.status == Status::Recalibrate) {
            f.share *= 1e-3;
        }
    }
}

/// A finding of less than this share of the explained mismatch is minor.
const MINOR: f64 = 0.01;

/// Converts nats to shares and sorts the findings, largest first.
pub(super) fn shares(found: &mut [Finding]) {
    let total: f64 = found.iter().map(|f| f.share.max(0.0)).sum();
    for f in found.iter_mut() {
        f.share = if total > 0.0 { f.share.max(0.0) / total } else { 0.0 };
        f.minor = f.status != Status::NotIdentifiable && f.share < MINOR && !f.is_law();
    }
    found.sort_by(|a, b| {
        let told = |f: &Finding| f.status == Status::NotIdentifiable;
        told(a).cmp(&told(b)).then(b.share.total_cmp(&a.share))
    });
}

/// `outcomes` are those of the mean and the variance. Where one could not be searched at all, finding
/// nothing is inconclusive.
pub(super) fn verdict(found: &[Finding], outcomes: [&Outcome; 2]) -> Verdict {
    match (found.is_empty(), outcomes.iter().all(|o| o.noise.is_tested())) {
        (false, _) => Verdict::Mismatch,
        (true, true) => Verdict::Match,
        (true, false) => Verdict::Inconclusive,
    }
}

/// Remarks on what could not be tested; the size of the noise is tested in blocks of so many tiles.
pub(super) fn untested([mean, variance]: [&Outcome; 2], block_tiles: usize) -> Vec<String> {
    let mean = (!mean.noise.is_tested())
        .then(|| "the mean error could not be tested: no view has enough of a target".to_string());
    let side = block_tiles * SIDE;
    let variance = (!variance.noise.is_tested()).then(|| {
        format!("the size of the noise could not be tested: no target fills a patch of {side} x {side} px")
    });
    mean.into_iter().chain(variance).collect()
}

/// Remark on what most views have too few frames to show. A line in time takes two of them.
pub(super) fn few_frames(fields: &[Field]) -> Option<String> {
    let most = |n: usize| 2 * fields.iter().filter(|f| f.frames.len() <= n).count() > fields.len();
    let (has, what) = if most(1) {
        (
            "have one frame",
            "noise that a view's frames or its rows have in common, frames that jitter and a target that moves",
        )
    } else {
        ("have two frames at most", "frames that jitter and a target that moves")
    };
    most(2).then(|| {
        format!("most views {has}: {what} were not looked for; record four or more frames a view")
    })
}

/// Remarks on the frames that were left out, and why.
pub(super) fn frames_left_out(fields: &[Field]) -> Vec<String> {
    let sum = |of: fn(&Field) -> usize| fields.iter().map(of).sum::<usize>();
    let [repeated, stale, lost] =
        [sum(|f| f.left_out.repeated), sum(|f| f.left_out.stale), sum(|f| f.left_out.lost)];
    let all = repeated + stale + lost + sum(|f| f.frames.len());
    let told = |n: usize, why: &str| {
        let were = if n == 1 { "was" } else { "were" };
        (n > 0).then(|| format!("{n} of {all} frames {were} left out: {why}"))
    };
    let repeated = told(repeated, "word for word the frame before");
    let lost = told(lost, "unreadable, or no pixel carries a depth");
    let stale = told(
        stale,
        "most of the target is not where the other first frames of the view show it; such a frame is stale or \
         damaged, or the frames jitter",
    );
    repeated.into_iter().chain(lost).chain(stale).collect()
}

/// Extends the model with the findings.
pub(super) fn extend<'a>(
    model: &NoiseModel,
    found: impl Iterator<Item = &'a Finding>,
    sensor: &Sensor,
    learnt_px: [f64; 2],
) -> NoiseModel {
    let mut extended = model.clone();
    if extended.sensor.is_none() {
        extended.sensor = Some(RecordingFile::of(sensor));
    }
    // The biases fitted by this diagnosis err together, and so do its variances.
    let fits = model.effects.iter().filter_map(|e| e.covariance.as_ref()).map(|c| c.fit);
    let fit = 1 + fits.max().unwrap_or(0);
    for f in found {
        let keeps = matches!(f.status, Status::Named | Status::OneOf) || !f.terms.is_empty();
        if !keeps || f.of_some.is_some() {
            continue;
        }
        let id = match (f.status, f.effect) {
            (Status::Recalibrate, _) | (_, None) => UNEXPLAINED,
            (_, Some(id)) => id,
        };
        let mut parameters = f.parameters.clone();
        if let Some(card) = effects::find(id).filter(|_| f.terms.is_empty()).map(|e| e.card()) {
            // The simulator takes only the catalogue's parameters, within their ranges.
            parameters.retain(|name, estimate| {
                let Some(known) = card.parameters.iter().find(|p| p.name == name) else {
                    return false;
                };
                let value = match estimate.get_mut("value") {
                    Some(value) => value,
                    None => estimate,
                };
                let Some(number) = value.as_f64() else { return false };
                let held = number.clamp(known.range[0], known.range[1]);
                if held != number {
                    *value = held.into();
                }
                true
            });
            // An effect of unmeasured strength is known, and is not simulated.
            if let Some(strength) = card.parameters.first() {
                let of = parameters.entry(strength.name);
                of.or_insert_with(|| card.identity.into());
            }
        }
        let shape = f.terms.clone();
        let bias = shape.iter().any(|t| t.statistic == Statistic::Bias);
        let learnt_px = bias.then_some(learnt_px);
        let covariance = Covariance { fit: fit + u32::from(!bias), ..f.covariance.clone() };
        let covariance = (!covariance.is_empty()).then(|| covariance.rounded());
        let id = id.into();
        let effect = Effect { id, parameters, shape, learnt_px, covariance, ..Effect::default() };
        // An effect without a shape is measured as a whole and replaces what the model had.
        let same = |e: &&mut Effect| e.id == effect.id && e.shape.is_empty();
        match extended.effects.iter_mut().find(same).filter(|_| effect.shape.is_empty()) {
            Some(had) => *had = effect,
            None => extended.effects.push(effect),
        }
    }
    extended
}

impl Diagnosis {
    /// Whether there are findings, but none that counts in the score of the held-out views.
    pub fn has_no_score(&self) -> bool {
        let nothing = self.heldout.as_ref().is_some_and(HeldOut::is_nothing);
        let mut found = self.findings.iter().filter(|f| f.status != Status::NotIdentifiable);
        nothing && found.clone().next().is_some() && !found.any(Finding::is_scored)
    }
}

impl Finding {
    /// Whether it counts in the score of the held-out views. Losses, steps, edges, laws of the distance,
    /// findings without terms and name, and those of some views only do not.
    pub fn is_scored(&self) -> bool {
        match self.statistic {
            _ if self.of_some.is_some() => false,
            Statistic::Bias if self.axis == Axis::Frame => self.effect.is_some(),
            Statistic::Bias | Statistic::Variance => self.curve.is_some() && !self.terms.is_empty(),
            Statistic::Dropout => false,
            Statistic::Distribution => self.axis == Axis::Residual && self.effect.is_some(),
            Statistic::Correlation => self.effect.is_some(),
        }
    }
}
