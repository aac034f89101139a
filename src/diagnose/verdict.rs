//! What is said in the end: the verdict, findings in order, the extended model.

use std::collections::BTreeSet;

use super::blocks::BLOCK_TILES;
use super::diagnosis::{CannotTell, Finding, Status, Verdict};
use super::other_findings::named;
use super::outcome::Outcome;
use super::tiles::SIDE;
use crate::effects;
use crate::model::{Covariance, Effect, NoiseModel, UNEXPLAINED};
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

/// A name is told once, by its strongest finding.
pub(super) fn merge(found: &mut Vec<Finding>) {
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    let mut names = BTreeSet::new();
    found.retain(|f| f.effect.is_none_or(|id| names.insert(id)));
}

/// Of ten such names on development seeds (501, 777, 902) none was the cause: by Jeffreys's prior.
const NO_SYMPTOM: f64 = 0.045;
/// What changes how noise is made, and so its size.
const MAKES_NOISE: [&str; 3] = ["spatial-correlation", "frozen-noise", "disparity-quantisation"];
/// Of the noise's standard deviation, from where on such a change is the first thing to tell.
const LARGE: f64 = 0.3;

/// A recording held against a simulation of the same physics: the size of the noise follows from
/// what makes it, and what the catalogue calls a cause is often a symptom.
pub(super) fn symptoms(found: &mut [Finding]) {
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
        // What moves past the pattern is matched anew in every frame.
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

fn is_symptom(id: &str) -> bool {
    effects::find(id).is_some_and(|e| e.card().is_symptom)
}

/// Where sigma itself is off by more, a law of depth or tilt alone beside it is the rest of the same
/// misfit: its terms, and nats, go to that finding.
pub(super) fn fold_into_sigma(found: &mut Vec<Finding>) {
    let Some(at) = found.iter().position(|f| f.status == Status::Recalibrate) else { return };
    let mut sigma = found.remove(at);
    let (rest, others): (Vec<Finding>, Vec<Finding>) =
        found.drain(..).partition(|f| of_sigma_alone(f) && f.share < sigma.share);
    *found = others;
    for f in rest {
        sigma.share += f.share;
        sigma.terms.extend(f.terms);
        sigma.covariance.extend(f.covariance);
    }
    found.insert(at.min(found.len()), sigma);
}

/// A frame that is noisier than the others is in the size of all: of a sigma that is off by less, that frame
/// is what is told.
pub(super) fn forget_noise_of_frames(found: &mut Vec<Finding>, textures: &[Finding]) {
    let of_frame = |f: &&Finding| f.statistic == Statistic::Variance && f.axis == Axis::Frame;
    let size = textures.iter().find(of_frame).map_or(0.0, |f| f.size.sigma);
    found.retain(|f| f.status != Status::Recalibrate || f.size.sigma > size);
}

fn of_sigma_alone(f: &Finding) -> bool {
    let axis = matches!(f.axis, Axis::Z | Axis::Theta);
    f.statistic == Statistic::Variance && axis && f.effect.is_none_or(|id| id == "range-exponent")
}

/// What adds to the spread of one frame, and so to a sigma that was calibrated with it in place.
const SPREADS: [&str; 6] = [
    "fixed-pattern-noise",
    "frozen-noise",
    "disparity-quantisation",
    "depth-rounding",
    "column-banding",
    "row-noise",
];

fn spreads(f: &Finding) -> bool {
    let named = matches!(f.status, Status::Named | Status::OneOf);
    named && (f.statistic == Statistic::Bias || f.effect.is_some_and(|id| SPREADS.contains(&id)))
}

/// A sigma that is too large was calibrated with the named causes in it: of such a finding only
/// what they do not account for counts, in variance.
pub(super) fn echoes(found: &mut [Finding]) {
    let explained: f64 = found.iter().filter(|f| spreads(f)).map(|f| f.size.sigma.powi(2)).sum();
    let largest = found.iter().filter(|f| spreads(f)).map(|f| f.share).fold(0.0, f64::max);
    for f in found.iter_mut().filter(|f| f.status == Status::Recalibrate) {
        let too_much = excess(f);
        if too_much > 0.0 && explained > 0.0 {
            f.share *= (1.0 - explained / too_much).max(0.0);
            if explained > HALF * too_much {
                f.share = f.share.min(0.99 * largest);
            }
        }
    }
}

/// From this share on a cause accounts for what sigma is off by.
const HALF: f64 = 0.5;

/// By how much the model's variance exceeds what was measured, in units of the model's; negative
/// where sigma is too small.
fn excess(f: &Finding) -> f64 {
    let Some(curve) = f.curve.as_ref().filter(|c| !c.model.is_empty()) else { return 0.0 };
    let mean = curve.model.iter().map(|ratio| ratio * ratio).sum::<f64>();
    1.0 - mean / curve.model.len() as f64
}

/// A finding of less than this share of the explained mismatch is minor.
const MINOR: f64 = 0.01;

/// Nats become shares, and the largest comes first.
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

/// `outcomes` are the mean's and the variance's: where one could not be searched at all, nothing found
/// says nothing.
pub(super) fn verdict(found: &[Finding], outcomes: [&Outcome; 2]) -> Verdict {
    match (found.is_empty(), outcomes.iter().all(|o| o.noise.is_tested())) {
        (false, _) => Verdict::Mismatch,
        (true, true) => Verdict::Match,
        (true, false) => Verdict::Inconclusive,
    }
}

/// What could not be tested, in words.
pub(super) fn untested([mean, variance]: [&Outcome; 2]) -> Vec<String> {
    let mean = (!mean.noise.is_tested())
        .then(|| "the mean error could not be tested: no view has enough of a target".to_string());
    let side = BLOCK_TILES * SIDE;
    let variance = (!variance.noise.is_tested()).then(|| {
        format!("the size of the noise could not be tested: no target fills a patch of {side} x {side} px")
    });
    mean.into_iter().chain(variance).collect()
}

/// The model with what was found.
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
    // What this diagnosis fitted errs together: its biases, and its variances.
    let fits = model.effects.iter().filter_map(|e| e.covariance.as_ref()).map(|c| c.fit);
    let fit = 1 + fits.max().unwrap_or(0);
    for f in found {
        let keeps = matches!(f.status, Status::Named | Status::OneOf) || !f.terms.is_empty();
        if !keeps {
            continue;
        }
        let id = match (f.status, f.effect) {
            (Status::Recalibrate, _) | (_, None) => UNEXPLAINED,
            (_, Some(id)) => id,
        };
        let mut parameters = f.parameters.clone();
        if let Some(card) = effects::find(id).filter(|_| f.terms.is_empty()).map(|e| e.card()) {
            // The simulator takes the catalogue's parameters alone, within their ranges.
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
        }
        let shape = f.terms.clone();
        let bias = shape.iter().any(|t| t.statistic == Statistic::Bias);
        let learnt_px = bias.then_some(learnt_px);
        let covariance = Covariance { fit: fit + u32::from(!bias), ..f.covariance.clone() };
        let covariance = (!covariance.is_empty()).then(|| covariance.rounded());
        let id = id.into();
        let effect = Effect { id, parameters, shape, learnt_px, covariance, ..Effect::default() };
        // What has no shape is measured whole: it takes the place of what the model had.
        let same = |e: &&mut Effect| e.id == effect.id && e.shape.is_empty();
        match extended.effects.iter_mut().find(same).filter(|_| effect.shape.is_empty()) {
            Some(had) => *had = effect,
            None => extended.effects.push(effect),
        }
    }
    extended
}

/// A bias or a change of variance smaller than this, in sigmas, is not told.
pub(super) const MIN_SIZE: f64 = 0.005;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::{Curve, Size};

    fn recalibrate(ratio: f64) -> Finding {
        let curve = Curve { model: vec![ratio; 8], ..Curve::default() };
        Finding {
            status: Status::Recalibrate,
            effect: None,
            share: 900.0,
            curve: Some(curve),
            ..named("range-exponent", Statistic::Variance, Axis::Z)
        }
    }

    fn bowl(sigma: f64) -> Finding {
        Finding {
            share: 100.0,
            size: Size { mm: 1.0, sigma },
            ..named("radial-disparity-bias", Statistic::Bias, Axis::Radius)
        }
    }

    /// The smaller of the two is the rest of the larger one's misfit; not the other way round.
    #[test]
    fn a_law_of_the_depth_beside_a_larger_misfit_of_sigma_is_part_of_it() {
        for (nats, left) in [(100.0, 1), (2000.0, 2)] {
            let exponent =
                Finding { share: nats, ..named("range-exponent", Statistic::Variance, Axis::Z) };
            let mut found = vec![exponent, recalibrate(1.2)];
            fold_into_sigma(&mut found);
            assert_eq!(found.len(), left);
            assert_eq!(found.iter().map(|f| f.share).sum::<f64>(), 900.0 + nats);
        }
    }

    /// Sigma calibrated with a bias of half its size in it; then too small a sigma, which no bias
    /// explains.
    #[test]
    fn the_echo_of_a_cause_never_comes_before_it() {
        let mut found = vec![recalibrate(0.75f64.sqrt()), bowl(0.5)];
        echoes(&mut found);
        shares(&mut found);
        assert_eq!(found[0].effect, Some("radial-disparity-bias"));
        assert!(found[1].share < 1e-9, "{}", found[1].share);
        let mut found = vec![recalibrate(1.3), bowl(0.5)];
        echoes(&mut found);
        shares(&mut found);
        assert_eq!(found[0].status, Status::Recalibrate);
    }

    #[test]
    fn a_noisier_frame_is_no_sigma_that_is_off() {
        let of = |sigma, f| Finding { effect: None, size: Size { mm: 0.0, sigma }, ..f };
        let (frame, row) = (Axis::Frame, Axis::Row);
        for (size, axis, left) in [(0.05, frame, 0), (0.4, frame, 1), (0.05, row, 1)] {
            let mut found = vec![of(size, recalibrate(1.1))];
            forget_noise_of_frames(&mut found, &[of(0.2, named("", Statistic::Variance, axis))]);
            assert_eq!(found.len(), left);
        }
    }
}
