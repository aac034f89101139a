//! Offset, scale and drift, which planes alone cannot determine, from distances measured by other means.

use super::laws::{Law, MIN_VIEWS, laws};
use super::referenced_view::referenced_views;
use crate::diagnose::case::Case;
use crate::diagnose::checks::overstated::SHARE;
use crate::diagnose::diagnosis::{Alternative, CannotTell, Finding, Size, Status};
use crate::diagnose::finding::naming::MIN_PROBABILITY;
use crate::diagnose::finding::other_findings::{named, nameless};
use crate::diagnose::finding::parameters::{estimate, one};
use crate::diagnose::joint::anchor::{Family, families};
use crate::diagnose::search::noise_gains::NoiseGains;
use crate::diagnose::search::null::student;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::known::KnownTerms;
use crate::diagnose::views::learnt::Learnt;
use crate::effects;
use crate::model::Effect;
use crate::rng::Seed;
use crate::sensors::SensorKind;
use crate::terms::{Axis, Statistic, Term};

/// Least effect of a law on the depth that no constant of a bias imitates, in errors of a reference; `MIN_M` is
/// the same in m. Tapes and planes are not better.
const CLEAR_LAW_ERRORS: f64 = 1.2;
const MIN_M: f64 = 0.0015;
/// Names that predict within this many nats of the best cannot be told apart.
const AS_GOOD_NATS: f64 = 3.0;

/// Distance between a bent target's plane and the place on it that was measured, m. The mean of a parabola is
/// 1.1 times its RMS from the vertex, and 2.2 times from the rim.
pub fn bent_m(found: &[Finding]) -> f64 {
    const FROM_PLACE: f64 = 2.0;
    let bent = |f: &&Finding| f.statistic == Statistic::Bias && f.axis == Axis::TargetPosition;
    1e-3 * FROM_PLACE * found.iter().filter(bent).map(|f| f.size.mm).fold(0.0, f64::hypot)
}

/// Findings from the references, if any.
/// `excess` is how far the variance of the levels may exceed their own errors, as a factor.
pub fn findings(
    laws: &[Law],
    known: &KnownTerms,
    excess: f64,
    level: f64,
    seed: Seed,
) -> Vec<Finding> {
    // An error estimated from few references makes a Student's t of a Gaussian.
    let calibrated_gain = |l: &Law| {
        let gain = (l.gain / l.null.dispersion / excess).max(0.0);
        student(gain, l.freedom)
    };
    let Some(best) = laws.iter().max_by(|a, b| a.gain.total_cmp(&b.gain)) else {
        return Vec::new();
    };
    let draws =
        |(n, law): (usize, &Law)| law.null.draws(&mut seed.stream(&format!("laws/null/{n}")));
    let of_noise: Vec<Vec<f64>> = laws.iter().enumerate().map(draws).collect();
    let noise = NoiseGains::of(of_noise.iter().map(Vec::as_slice));
    // A model learnt from references may itself lack a law of this size.
    let clear = best.beyond_errors > CLEAR_LAW_ERRORS * excess.sqrt() && best.beyond_m > MIN_M;
    if !clear || calibrated_gain(best) < noise.threshold(level) {
        return Vec::new();
    }
    let [beta, error] = best.estimate;
    if let Some(had) = known.law(best.family) {
        // Sessions and references differ by a part of a law, but not by half of it.
        let other = beta.abs() - 2.0 * error > SHARE * had.abs();
        return Vec::from_iter(other.then(|| contradicted(best, noise.p(calibrated_gain(best)))));
    }
    let mut odds = ["depth-scale", "disparity-offset", "thermal-drift"].map(|family| {
        let gains = laws.iter().filter(|l| l.family == family).map(|l| l.gain);
        (family, (0.5 * (gains.fold(f64::NEG_INFINITY, f64::max) - best.gain)).exp())
    });
    odds.sort_by(|a, b| b.1.total_cmp(&a.1));
    // The last term is the odds of no law at all.
    let total: f64 = odds.iter().map(|o| o.1).sum::<f64>() + (-0.5 * best.gain).exp();
    let alternatives: Vec<Alternative> = odds
        .iter()
        .map(|&(effect, o)| (effect, o / total))
        .filter(|a| a.1 > MIN_PROBABILITY)
        .map(|(effect, p)| Alternative { effect, probability: Some(p) })
        .collect();
    let close = odds[1].1 > (-0.5 * AS_GOOD_NATS).exp();
    let mut parameters = match best.family {
        "depth-scale" => one("scale", 1.0 + beta, error),
        "disparity-offset" => one("offset_px", beta, error),
        _ => one("relative", beta, error),
    };
    for (name, [value, error]) in &best.settled {
        parameters.insert((*name).into(), estimate(*value, *error));
    }
    let status = if close { Status::OneOf } else { Status::Named };
    vec![Finding {
        status,
        alternatives,
        interval: best.reach,
        share: best.gain,
        parameters,
        size: Size { mm: 1e3 * best.rms_m, sigma: best.rms_sigma },
        p_adjusted: Some(noise.p(calibrated_gain(best))),
        replicated: best.replicated,
        ..named(best.family, Statistic::Bias, best.axis)
    }]
}

/// Finding that the references contradict the model's law.
fn contradicted(law: &Law, p: f64) -> Finding {
    let shape = format!(
        "the model's {} is off by {:.1} mm at the references' distances, more than half of it",
        law.family,
        1e3 * law.rms_m
    );
    Finding {
        interval: law.reach,
        share: law.gain,
        size: Size { mm: 1e3 * law.rms_m, sigma: law.rms_sigma },
        p_adjusted: Some(p),
        replicated: law.replicated,
        physics: format!(
            "Not of this sensor: {shape}. Take it out of the model, or learn it again from references."
        ),
        shape: Some(shape),
        contradicted: Some(law.family),
        ..nameless(Statistic::Bias, law.axis)
    }
}

/// Whether an offset of the disparity may be no more than the unknown constant of a shape fixed in the
/// picture, of `usual` px: within two standard deviations of it.
fn is_constant_of(law: &Finding, usual: f64) -> bool {
    const DEVIATIONS: f64 = 2.0;
    law.value("offset_px").is_some_and(|px| px.abs() < DEVIATIONS * usual)
}

/// Whether the effect occurs in cameras of this kind.
pub fn can_happen(id: &str, kind: Option<SensorKind>) -> bool {
    effects::find(id).is_none_or(|e| e.card().applies_to(kind))
}

impl Case<'_> {
    /// Finds laws of distance error by the reference distances.
    pub(in crate::diagnose) fn laws(&self, bias: &[Term], bent_m: f64) -> Vec<Finding> {
        let ours = references(&self.fields);
        if ours < MIN_VIEWS {
            return Vec::new();
        }
        let mut learnt = Effect { shape: bias.to_vec(), ..Effect::default() };
        self.let_distances_be(std::slice::from_mut(&mut learnt));
        let bias = &learnt.shape;
        // Only terms that vanish on the optical axis by their physics show how far the plane bent there.
        let anchored: Vec<Term> =
            bias.iter().filter(|t| t.basis.is_nothing_ahead()).cloned().collect();
        // The catalogue's bowl vanishes there too; its offset is stated on that basis.
        let of_catalogue = |t: &&Term| t.basis.is_nothing_ahead() || t.basis.is_bowl();
        let plain: Vec<Term> = bias.iter().filter(of_catalogue).cloned().collect();
        let views = self.fields.len() as f64;
        // The levels carry the error of the model's bias, and its own references, if any, leave a law
        // uncertain.
        let of_bias = self.survey.learnt_from[0].map(|l| l.of_difference(views));
        let theirs =
            Learnt::references(self.model).filter(|_| self.survey.learnt_from[1].is_some());
        let of_laws = theirs.map(|l| l.excess(ours as f64));
        let excess = of_bias.unwrap_or(1.0).max(of_laws.unwrap_or(1.0));
        let found = |terms: &[Term], open: &[Family]| {
            let checked = referenced_views(&self.fields, &self.survey, terms, &self.known);
            let mut laws = laws(&checked, bent_m, open);
            laws.retain(|l| can_happen(l.family, self.sensor().kind));
            let level = self.level(Self::LAWS_LEVEL);
            findings(&laws, &self.known, excess, level, self.options.seed)
        };
        // A bowl moves the plane on the axis too, by an unknown constant.
        let of_model = self.known.bias_terms();
        let open = families(bias.iter().chain(of_model.clone()), &self.sensor().camera);
        if !open.is_empty() {
            let laws = found(bias, &open);
            if !laws.is_empty() {
                return laws;
            }
        }
        // All of it may be an offset of the disparity: a law must hold with and without the bowl, be that new
        // or the model's.
        let model = of_model.filter(|t| !t.basis.is_nothing_ahead());
        let model: Vec<Term> = model.map(|t| t.times(-1.0)).collect();
        let mut laws = found(&plain, &[]);
        for others in [anchored.clone(), bias.to_vec(), [anchored, model].concat()] {
            if others != plain && !laws.is_empty() {
                let with = found(&others, &[]);
                laws.retain(|l| with.iter().any(|w| w.effect == l.effect));
            }
        }
        let nameless = bias.iter().filter(|t| !of_catalogue(t));
        let own = families(nameless, &self.sensor().camera).iter().map(Family::still_px).sum();
        laws.retain(|l| l.status != Status::Named || !is_constant_of(l, own));
        laws
    }
}

/// Number of views with a reference.
pub fn references(fields: &[Field]) -> usize {
    fields.iter().filter(|f| f.reference_distance_m.is_some()).count()
}

/// Effects that planes alone cannot show.
pub fn cannot_tell(fields: &[Field], kind: Option<SensorKind>) -> Vec<CannotTell> {
    if references(fields) >= MIN_VIEWS {
        return Vec::new();
    }
    let why = |what: &str| {
        format!(
            "{what} is not identifiable from planes without a reference distance: every plane takes it up whole. Measure the distance of the target in at least {MIN_VIEWS} views with a tape or a rail and give it as reference_distance_m."
        )
    };
    let mut all = vec![
        CannotTell { effect: "depth-scale", why: why("A wrong scale of the depth") },
        CannotTell { effect: "disparity-offset", why: why("A wrong offset of the disparity") },
        CannotTell { effect: "thermal-drift", why: why("A drift of the scale over the session") },
    ];
    all.retain(|c| can_happen(c.effect, kind));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_as_large_as_a_still_shape_is_its_constant() {
        let law = |id, name, value| Finding {
            parameters: one(name, value, 0.001),
            ..named(id, Statistic::Bias, Axis::Z)
        };
        let offset = |px| law("disparity-offset", "offset_px", px);
        assert!(is_constant_of(&offset(-0.016), 0.01));
        assert!(!is_constant_of(&offset(0.021), 0.01) && !is_constant_of(&offset(0.016), 0.0));
        assert!(!is_constant_of(&law("depth-scale", "scale", 0.016), 0.01));
    }
}
