//! Detection power: the size of a shape that a layer's search would find in 80 % of such recordings.
//!
//! The criteria are those of the search itself, without replication in halves, and on patches of two tiles:
//! the null threshold for the gain over the views' dispersion, the share of the first finding's gain, and the
//! size relative to the largest. Predicted from the other views, a shape of size s gains s^2 times what it
//! gains at size 1, with standard deviation s sqrt(I d) for an information I and a dispersion d, less what the
//! errors of the fitted coefficients cost.

use nalgebra::DVector;
use serde_json::{Map, json};

use crate::diagnose::case::Case;
use crate::diagnose::diagnosis::Detectable;
use crate::diagnose::finding::pixels::terms_of;
use crate::diagnose::finding::scene::Scene;
use crate::diagnose::options::POWER_80;
use crate::diagnose::search::MIN_SHARE_OF_GAIN;
use crate::diagnose::search::beside::Beside;
use crate::diagnose::search::candidate::{Candidate, RECALIBRATE};
use crate::diagnose::search::evidence::{Evidence, gain};
use crate::diagnose::search::layer_null::Group;
use crate::diagnose::search::null::Null;
use crate::diagnose::search::outcome::{Chosen, Outcome};
use crate::diagnose::search::prepared::evidence_of_bases;
use crate::diagnose::search::rules::Rules;
use crate::diagnose::search::variance::beyond_sigma;
use crate::diagnose::views::samples::ViewData;
use crate::effects::{self, Smallest};
use crate::solve::Cholesky;
use crate::terms::{Basis, Term};

/// A layer as it was searched.
pub struct DetectionCriteria<'a> {
    pub scene: &'a Scene<'a>,
    pub outcome: &'a Outcome,
    pub rules: Rules,
    /// Basis fitted beside everything.
    pub beside: Option<Basis>,
}

impl DetectionCriteria<'_> {
    /// Smallest detected multiple of `unit`, a term of size one; `None` where there is none.
    pub fn min_size(&self, unit: &Term) -> Option<f64> {
        // With sigma refitted, what depends on depth and tilt alone is not searched for.
        if self.beside.is_some() && !beyond_sigma(&Candidate::curve(unit.basis.clone())) {
            return None;
        }
        let bases: Vec<&Basis> = self.beside.iter().chain([&unit.basis]).collect();
        let m = self.beside.as_ref().map_or(0, Basis::count);
        let views = evidence_of_bases(&self.left(), &bases);
        let alone = Beside::of(&views, m, self.rules.prior)?.alone(&views);
        let null = Null::of_candidate(&alone, self.rules.prior)?;
        let first = self.found().next().map_or(0.0, |c| c.gain);
        let rules = self.rules.beside(self.found().count());
        let threshold = self.outcome.noise.threshold(Group::Named, rules.level);
        let need =
            null.gain_for(threshold, alone.len(), &self.rules).max(MIN_SHARE_OF_GAIN * first);
        let u = DVector::from_column_slice(&unit.coefficients);
        let information = u.dot(&(&Evidence::sum(u.len(), 0.0, &alone).a * &u));
        if !need.is_finite() || information <= 0.0 {
            return None;
        }
        let dispersion = null.scatter(&self.rules);
        let need = need + dispersion * cost(&alone, self.rules.prior)?;
        let margin = POWER_80 * dispersion.sqrt();
        let one = gain_of_one(&views, &u, self.rules.prior).filter(|gain| *gain > 0.0)?;
        let scatter = margin * information.sqrt();
        let by_gain = (scatter + (scatter * scatter + 4.0 * one * need).sqrt()) / (2.0 * one);
        let largest = self.found().map(|c| c.rms).fold(0.0, f64::max);
        let weight: f64 = self.scene.data.iter().flat_map(|v| &v.weight).sum();
        // The size is that of the shape, whatever else is fitted beside it.
        let own = |v: &Evidence| u.dot(&(v.a.view((m, m), (u.len(), u.len())) * &u));
        let by_size = self.rules.min_rms(&unit.basis, largest)
            * (weight / views.iter().map(own).sum::<f64>()).sqrt()
            + margin / information.sqrt();
        Some(by_gain.max(by_size)).filter(|size| *size > 0.0 && size.is_finite())
    }

    /// Terms that the search chose, without the refit of sigma that was fitted beside them.
    fn found(&self) -> impl Iterator<Item = &Chosen> {
        let refit = |c: &Chosen| c.candidate.family == Some(RECALIBRATE) && self.beside.is_some();
        self.outcome.chosen.iter().filter(move |c| !refit(c))
    }

    /// The views with the findings subtracted: these would not be taken for a further effect.
    fn left(&self) -> Vec<ViewData> {
        let found = terms_of(self.outcome, self.scene.statistic);
        let left = |view: &ViewData| ViewData { response: view.without(&found), ..view.clone() };
        self.scene.data.iter().map(left).collect()
    }
}

/// Mean gain, nats, of the shape `u` at size 1, which is the last of the columns: each view is predicted from
/// the others, from which the columns beside it are fitted too.
fn gain_of_one(views: &[Evidence], u: &DVector<f64>, prior: f64) -> Option<f64> {
    let m = views.first()?.b.len() - u.len();
    let seen = |v: &Evidence| Evidence { a: v.a.clone(), b: v.a.columns(m, u.len()) * u };
    let mut whole: Vec<Evidence> = views.iter().map(seen).collect();
    let with = gain(&whole, prior)?.total;
    whole.iter_mut().for_each(|e| e.truncate(m));
    Some(with - gain(&whole, prior)?.total)
}

/// Mean loss of the coefficients' own errors where each view is predicted from the others, in nats at a
/// dispersion of 1: half a nat a coefficient, and more where one view has most of the information.
fn cost(views: &[Evidence], prior: f64) -> Option<f64> {
    let all = Evidence::sum(views.first()?.b.len(), prior, views).a;
    let of = |v: &Evidence| Some(Cholesky::of(&all - &v.a)?.solve_all(v.a.clone()).trace());
    Some(0.5 * views.iter().map(of).sum::<Option<f64>>()?)
}

impl Case<'_> {
    /// Smallest parameter of each family that would be found with 80 % power.
    pub(in crate::diagnose) fn detectable(
        &self,
        [mean, size]: &[Scene<'_>; 2],
        [bias, variance]: [&Outcome; 2],
    ) -> Vec<Detectable> {
        let (survey, camera) = (&self.survey, &self.sensor().camera);
        let of_mean = DetectionCriteria {
            scene: mean,
            outcome: bias,
            rules: survey.bias_rules(camera, self.level(Case::MEAN_LEVEL)),
            beside: None,
        };
        let of_size = DetectionCriteria {
            scene: size,
            outcome: variance,
            rules: survey.variance_rules(self.level(Case::VARIANCE_LEVEL)),
            beside: survey.refitted().map(|c| c.basis),
        };
        let bounds = survey.bounds(camera);
        let mut all = Vec::new();
        for gates in [&of_mean, &of_size] {
            let statistic = gates.scene.statistic;
            let can = effects::that_change(statistic);
            for effect in can.filter(|e| e.card().applies_to(bounds.kind)) {
                let Some(Smallest { parameter, shape, unit, of }) = effect.smallest(&bounds) else {
                    continue;
                };
                let term = Term { statistic, basis: shape, coefficients: unit };
                let size = gates.min_size(&term).map(of).filter(|size| size.is_finite());
                all.extend(size.map(|size| Detectable {
                    effect: effect.card().id,
                    minimum: Map::from_iter([(parameter.to_string(), json!(size))]),
                }));
            }
        }
        all
    }
}
