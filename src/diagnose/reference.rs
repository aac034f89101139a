//! What planes alone cannot tell: offset, scale and drift, where distances were measured by other
//! means.

use serde_json::Map;

use super::diagnosis::{Alternative, CannotTell, Finding, Size, Status};
use super::field::Field;
use super::known::KnownTerms;
use super::laws::{FEWEST, Law};
use super::naming::{MIN_PROBABILITY, physics};
use super::null::{NoiseGains, Null, student};
use super::parameters::estimate;
use crate::effects;
use crate::model::Covariance;
use crate::rng::Seed;
use crate::sensors::SensorKind;
use crate::terms::{Axis, Statistic};

/// A law must move the depth by this many errors of a reference, and by this much, m: tapes and
/// planes are not better.
const CLEARLY: f64 = 1.2;
const LEAST_M: f64 = 0.0015;
/// Names that predict as well as the best within this many nats cannot be told apart.
const AS_GOOD_NATS: f64 = 3.0;

/// How far a bent target's plane may lie from the place on it that was measured, m: of a parabola the
/// mean is 1.1 root mean squares from its vertex, and 2.2 from its rim.
pub fn bent_m(found: &[Finding]) -> f64 {
    const FROM_PLACE: f64 = 2.0;
    let bent = |f: &&Finding| f.statistic == Statistic::Bias && f.axis == Axis::TargetPosition;
    1e-3 * FROM_PLACE * found.iter().filter(bent).map(|f| f.size.mm).fold(0.0, f64::hypot)
}

/// What the references tell, if anything.
/// `excess` is how much further than by their own error the levels may be off, in variance.
pub fn findings(
    laws: &[Law],
    known: &KnownTerms,
    excess: f64,
    level: f64,
    seed: Seed,
) -> Vec<Finding> {
    let nulls: Vec<&Null> = laws.iter().map(|l| &l.null).collect();
    if nulls.is_empty() {
        return Vec::new();
    }
    let noise = NoiseGains::of(&nulls, Seed(seed.0 ^ 0x5eed));
    // An error measured on few references makes a Student's t of a Gaussian.
    let safe = |l: &Law| {
        let gain = (l.gain / l.null.dispersion / excess).max(0.0);
        student(gain, l.freedom)
    };
    let Some(best) = laws.iter().max_by(|a, b| a.gain.total_cmp(&b.gain)) else {
        return Vec::new();
    };
    // So large a law may be missing in the model, too, where it was learnt from references.
    let small = best.rms_m < (CLEARLY * best.error_m * excess.sqrt()).max(LEAST_M);
    if small || safe(best) < noise.threshold(level) || known.has(best.family) {
        return Vec::new();
    }
    let mut odds: Vec<(&'static str, f64)> = Vec::new();
    for family in ["depth-scale", "disparity-offset", "thermal-drift"] {
        let most = laws
            .iter()
            .filter(|l| l.family == family)
            .map(|l| l.gain)
            .fold(f64::NEG_INFINITY, f64::max);
        odds.push((family, (0.5 * (most - best.gain)).exp()));
    }
    odds.sort_by(|a, b| b.1.total_cmp(&a.1));
    // No law at all explains what chance does.
    let total: f64 = odds.iter().map(|o| o.1).sum::<f64>() + (-0.5 * best.gain).exp();
    let alternatives: Vec<Alternative> = odds
        .iter()
        .map(|&(effect, o)| (effect, o / total))
        .filter(|a| a.1 > MIN_PROBABILITY)
        .map(|(effect, p)| Alternative { effect, probability: Some(p) })
        .collect();
    let close = odds.get(1).is_some_and(|o| o.1 > (-0.5 * AS_GOOD_NATS).exp());
    let [beta, error] = best.estimate;
    let mut parameters = Map::new();
    match best.family {
        "depth-scale" => parameters.insert("scale".into(), estimate(1.0 + beta, error)),
        "disparity-offset" => parameters.insert("offset_px".into(), estimate(beta, error)),
        _ => parameters.insert("relative".into(), estimate(beta, error)),
    };
    for (name, [value, error]) in &best.settled {
        parameters.insert((*name).into(), estimate(*value, *error));
    }
    let status = if close { Status::OneOf } else { Status::Named };
    vec![Finding {
        status,
        effect: Some(best.family),
        alternatives,
        statistic: Statistic::Bias,
        axis: best.axis,
        interval: best.reach,
        unit: best.axis.unit(),
        share: best.gain,
        minor: false,
        parameters,
        size: Size { mm: 1e3 * best.rms_m, sigma: best.rms_sigma },
        p_adjusted: Some(noise.p(safe(best))),
        replicated: best.replicated,
        physics: physics(status, Some(best.family), Statistic::Bias, best.axis, None),
        next_view: None,
        shape: None,
        curve: None,
        terms: Vec::new(),
        covariance: Covariance::default(),
    }]
}

/// What planes alone never tell.
pub fn cannot_tell(fields: &[Field], kind: Option<SensorKind>) -> Vec<CannotTell> {
    if fields.iter().filter(|f| f.reference_distance_m.is_some()).count() >= FEWEST {
        return Vec::new();
    }
    let why = |what: &str| {
        format!(
            "{what} is not identifiable from planes without a reference distance: every plane takes it up whole. Measure the distance of the target in at least {FEWEST} views with a tape or a rail and give it as reference_distance_m."
        )
    };
    let mut all = vec![
        CannotTell { effect: "depth-scale", why: why("A wrong scale of the depth") },
        CannotTell { effect: "disparity-offset", why: why("A wrong offset of the disparity") },
        CannotTell { effect: "thermal-drift", why: why("A drift of the scale over the session") },
    ];
    all.retain(|c| effects::find(c.effect).is_none_or(|e| e.card().applies_to(kind)));
    all
}
