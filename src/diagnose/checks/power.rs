//! How small an effect a recording could have shown: what size of a shape a layer's search would see in
//! 80 % of such recordings.
//!
//! The gates are those of the search itself, but for whether halves of the views agree, and on patches of
//! two tiles: the threshold of the null over the dispersion of the views, the share of what was found
//! first, and the size beside the largest. Noise is drawn from the views' own information, and with the
//! shape added its gain and its size are quadratic in the shape's size.

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use crate::diagnose::case::Case;
use crate::diagnose::diagnosis::Detectable;
use crate::diagnose::finding::pixels::terms_of;
use crate::diagnose::finding::scene::Scene;
use crate::diagnose::search::MIN_SHARE_OF_GAIN;
use crate::diagnose::search::candidate::Candidate;
use crate::diagnose::search::evidence::{Evidence, gain, root};
use crate::diagnose::search::null::Null;
use crate::diagnose::search::outcome::Outcome;
use crate::diagnose::search::prepared::evidence_of_bases;
use crate::diagnose::search::rules::Rules;
use crate::diagnose::search::variance::beyond_sigma;
use crate::diagnose::views::samples::ViewData;
use crate::effects::{self, Smallest};
use crate::rng::Seed;
use crate::terms::{Basis, Statistic, Term};

/// Of the recordings, so many show it.
const POWER: f64 = 0.8;
const REPLICATES: u64 = 200;

/// A layer as it was searched.
pub struct DetectionCriteria<'a> {
    pub scene: &'a Scene<'a>,
    pub outcome: &'a Outcome,
    pub rules: Rules,
    /// Fitted beside everything.
    pub beside: Option<Basis>,
    pub seed: Seed,
}

/// c0 + c1 x + c2 x^2.
struct Quadratic([f64; 3]);

impl Quadratic {
    /// Through the values at 0, x and 2 x.
    fn through([zero, one, two]: [f64; 3], x: f64) -> Self {
        let bend = 0.5 * (two - 2.0 * one + zero);
        Quadratic([zero, (one - zero - bend) / x, bend / (x * x)])
    }

    /// From where on it stays above `level`.
    fn above(&self, level: f64) -> f64 {
        let Quadratic([c, b, a]) = self;
        let root = b * b - 4.0 * a * (c - level);
        match (*a > 0.0, root > 0.0) {
            (false, _) => f64::INFINITY,
            (true, false) => 0.0,
            (true, true) => ((root.sqrt() - b) / (2.0 * a)).max(0.0),
        }
    }
}

impl DetectionCriteria<'_> {
    /// Multiple of the term, which is of size one, that is seen; `None` where none is.
    pub fn min_size(&self, unit: &Term) -> Option<f64> {
        // Beside sigma's own refit, what follows depth and tilt alone is not looked for.
        if self.beside.is_some() && !beyond_sigma(&Candidate::curve(unit.basis.clone())) {
            return None;
        }
        let bases: Vec<&Basis> = self.beside.iter().chain([&unit.basis]).collect();
        let m = self.beside.as_ref().map_or(0, Basis::count);
        let views = evidence_of_bases(&self.left(), &bases);
        let u = DVector::from_vec([vec![0.0; m], unit.coefficients.clone()].concat());
        let null = Null::of(&views, m, self.rules.prior)?;
        let dispersion = null.scatter(&self.rules);
        let first = self.outcome.chosen.first().map_or(0.0, |c| c.gain);
        let threshold = self.outcome.noise.threshold(self.rules.level);
        let need =
            null.gain_for(threshold, views.len(), &self.rules).max(MIN_SHARE_OF_GAIN * first);
        let sum = Evidence::sum(u.len(), 0.0, &views).a;
        let information = u.dot(&(&sum * &u));
        if !need.is_finite() || information <= 0.0 {
            return None;
        }
        let draw = Draw {
            roots: views.iter().map(|v| root(&v.a) * dispersion.sqrt()).collect(),
            views: &views,
            u: &u,
            m,
            step: (2.0 * need / information).sqrt(),
            prior: self.rules.prior,
            sum: &sum,
        };
        let largest = self.outcome.chosen.iter().map(|c| c.rms).fold(0.0, f64::max);
        let floor = self.rules.min_rms(&unit.basis, largest);
        let weight: f64 = self.scene.data.iter().flat_map(|v| &v.weight).sum();
        let sizes: Option<Vec<f64>> = (0..REPLICATES)
            .into_par_iter()
            .map(|replicate| {
                let mut rng = self.seed.stream(&format!("diagnose/power/{replicate}"));
                let (gain, square) = draw.once(&mut rng)?;
                Some(gain.above(need).max(square.above(floor * floor * weight)))
            })
            .collect();
        let mut sizes = sizes?;
        sizes.sort_by(f64::total_cmp);
        let min_size = sizes[(POWER * (sizes.len() - 1) as f64).ceil() as usize];
        (min_size > 0.0 && min_size.is_finite()).then_some(min_size)
    }

    /// The views without what was found: it would not be taken for an effect more.
    fn left(&self) -> Vec<ViewData> {
        let found = terms_of(self.outcome, self.scene.statistic);
        let left = |view: &ViewData| ViewData { response: view.without(&found), ..view.clone() };
        self.scene.data.iter().map(left).collect()
    }
}

/// Recordings of the shape and of noise.
struct Draw<'a> {
    views: &'a [Evidence],
    roots: Vec<DMatrix<f64>>,
    u: &'a DVector<f64>,
    /// Columns beside the shape's.
    m: usize,
    step: f64,
    prior: f64,
    sum: &'a DMatrix<f64>,
}

impl Draw<'_> {
    /// Gain and weighted square of the fit, over the shape's size.
    fn once(&self, rng: &mut crate::rng::Stream) -> Option<(Quadratic, Quadratic)> {
        let noise: Vec<DVector<f64>> = self
            .roots
            .iter()
            .map(|r| r * DVector::from_fn(r.ncols(), |_, _| StandardNormal.sample(rng)))
            .collect();
        let (m, k) = (self.m, self.u.len() - self.m);
        let own = self.sum.view((m, m), (k, k));
        let mut gains = [0.0; 3];
        let mut squares = [0.0; 3];
        for (n, (g, s)) in gains.iter_mut().zip(&mut squares).enumerate() {
            let size = n as f64 * self.step;
            let with = |(v, b): (&Evidence, &DVector<f64>)| Evidence {
                a: v.a.clone(),
                b: b + &v.a * self.u * size,
            };
            let views: Vec<Evidence> = self.views.iter().zip(&noise).map(with).collect();
            let whole = gain(&views, self.prior)?;
            *g = whole.total - self.base(&views)?;
            let beta = whole.beta.rows(m, k);
            *s = beta.dot(&(own * beta));
        }
        let through = |values| Quadratic::through(values, self.step);
        Some((through(gains), through(squares)))
    }

    /// What the columns beside bring alone.
    fn base(&self, views: &[Evidence]) -> Option<f64> {
        let m = self.m;
        let part = |v: &Evidence| Evidence {
            a: v.a.view((0, 0), (m, m)).into_owned(),
            b: v.b.rows(0, m).into_owned(),
        };
        let beside: Vec<Evidence> = views.iter().map(part).collect();
        Some(gain(&beside, self.prior)?.total)
    }
}

impl Case<'_> {
    /// The least parameter of each family that would be found with 80 % power.
    pub(in crate::diagnose) fn detectable(
        &self,
        [mean, size]: &[Scene<'_>; 2],
        [bias, variance]: [&Outcome; 2],
    ) -> Vec<Detectable> {
        let (survey, camera) = (&self.survey, &self.sensor().camera);
        let seed = self.options.seed;
        let of_mean = DetectionCriteria {
            scene: mean,
            outcome: bias,
            rules: survey.bias_rules(camera, self.level(Case::MEAN_LEVEL)),
            beside: None,
            seed,
        };
        let of_size = DetectionCriteria {
            scene: size,
            outcome: variance,
            rules: survey.variance_rules(self.level(Case::VARIANCE_LEVEL)),
            beside: survey.refitted().map(|c| c.basis),
            seed,
        };
        let bounds = survey.bounds(camera);
        let mut all = Vec::new();
        for (statistic, gates) in [(Statistic::Bias, &of_mean), (Statistic::Variance, &of_size)] {
            let can = effects::that_change(statistic).into_iter();
            for effect in can.filter(|e| e.card().applies_to(bounds.kind)) {
                let smallest = effect.smallest(&bounds).and_then(|s| min_size(s, statistic, gates));
                all.extend(
                    smallest.map(|minimum| Detectable { effect: effect.card().id, minimum }),
                );
            }
        }
        all
    }
}

fn min_size(
    smallest: Smallest,
    statistic: Statistic,
    gates: &DetectionCriteria<'_>,
) -> Option<Map<String, Value>> {
    let Smallest { parameter, shape, unit, of } = smallest;
    let term = Term { statistic, basis: shape, coefficients: unit };
    let min_size = gates.min_size(&term).map(of).filter(|min_size| min_size.is_finite())?;
    Some(Map::from_iter([(parameter.to_string(), json!(min_size))]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadratic_is_above_a_level_from_its_larger_root_on() {
        let square = Quadratic::through([1.0, 4.0, 9.0], 1.0);
        approx::assert_relative_eq!(square.above(16.0), 3.0, max_relative = 1e-12);
        assert_eq!(square.above(-1.0), 0.0);
        assert_eq!(Quadratic::through([0.0, 1.0, 0.0], 1.0).above(2.0), f64::INFINITY);
    }
}
