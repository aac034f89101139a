//! The model's known effects, which are subtracted before any search.

use std::collections::BTreeMap;

use crate::camera::Camera;
use crate::effects::{Active, RAY_FOR_DEPTH};
use crate::model::{Covariance, Effect, NoiseModel, UNEXPLAINED};
use crate::stats::mean;
use crate::terms::{ANYWHERE, Axis, Basis, LearntTerm, Statistic, Term, by_term};

/// The model's effects as terms; those without a formula by name only.
#[derive(Debug, Clone, Default)]
pub struct KnownTerms {
    /// Terms of the disparity, px, each with the disparities at which it was learnt.
    pub bias: Vec<LearntTerm>,
    /// Terms of the logarithm of its variance.
    pub variance: Vec<Term>,
    effects: Vec<Effect>,
}

impl KnownTerms {
    pub fn of(model: &NoiseModel, camera: &Camera) -> Self {
        let mut known = KnownTerms::default();
        for effect in &model.effects {
            let mut effect = effect.clone();
            let is_formula = effect.shape.is_empty();
            let formula = if is_formula { Active::from_model(&effect).ok() } else { None };
            let term = formula.as_ref().and_then(|f| f.effect.term(&f.settings, camera));
            if let Some(Active { effect: catalogue, settings }) = &formula {
                // What the entry leaves out is typical, as it is simulated and corrected.
                for (k, parameter) in catalogue.card().parameters.iter().enumerate() {
                    let stated = effect.parameters.entry(parameter.name);
                    stated.or_insert_with(|| settings.at(k).into());
                }
            }
            let learnt = effect.learnt_px.unwrap_or(ANYWHERE);
            for term in effect.shape.iter().chain(&term) {
                match term.statistic {
                    Statistic::Bias => known.bias.push((term.clone(), learnt)),
                    Statistic::Variance => known.variance.push(term.clone()),
                    _ => {}
                }
            }
            known.effects.push(effect);
        }
        known
    }

    /// Terms of the bias and of the variance over the light, which is known once all views are read.
    pub fn light_terms(&self) -> [Vec<Term>; 2] {
        let mine = |t: &&Term| t.needs().light;
        let variance = self.variance.iter().filter(mine).cloned().collect();
        [self.bias_terms().filter(mine).cloned().collect(), variance]
    }

    /// Terms of the bias, wherever they were learnt.
    pub fn bias_terms(&self) -> impl Iterator<Item = &Term> + Clone {
        self.bias.iter().map(|(term, _)| term)
    }

    /// Marks a parameter of an effect as known, without subtracting anything.
    pub fn learn(&mut self, id: &str, name: &str, value: f64) {
        let at = self.effects.iter().position(|known| known.id == id);
        let at = at.unwrap_or_else(|| {
            self.effects.push(Effect { id: id.into(), ..Effect::default() });
            self.effects.len() - 1
        });
        self.effects[at].parameters.insert(name.into(), value.into());
    }

    /// Marks all parameters of `found` as known, overriding what was learnt since.
    pub fn overrule(&mut self, found: &KnownTerms) {
        for effect in &found.effects {
            for name in effect.parameters.keys() {
                if let Some(value) = effect.number(name) {
                    self.learn(&effect.id, name, value);
                }
            }
        }
    }

    /// Whether a part of the bias is a fitted shape.
    pub fn bias_is_learnt(&self) -> bool {
        self.effects.iter().flat_map(|e| &e.shape).any(|t| t.statistic == Statistic::Bias)
    }

    /// Share of the ray's excess over the depth that raw values hold.
    pub fn ray_share(&self) -> f64 {
        ray_share(self.bias_terms())
    }

    /// Whether the size of the noise varies in a way that has no name.
    pub fn has_uneven_noise(&self) -> bool {
        let nameless = |t: &Term| {
            use Basis::{Curve, Map, Pair, Ring};
            matches!(t.basis, Curve { .. } | Ring { .. } | Map { .. } | Pair { .. })
        };
        self.has(UNEXPLAINED) && self.variance.iter().any(nameless)
    }

    /// Scatter of single views about the known terms: one standard deviation of each.
    pub fn between_views(&self, statistic: Statistic) -> Vec<Term> {
        let terms = self.effects.iter().flat_map(|e| e.shape.iter().zip(&e.between_views));
        let mine = terms.filter(|(t, share)| t.statistic == statistic && **share > 0.0);
        mine.map(|(t, share)| t.times(*share)).collect()
    }

    /// Fitted shapes with the covariance of their coefficients.
    fn learnt(&self) -> impl Iterator<Item = (&[Term], &Covariance)> {
        self.effects.iter().filter_map(|e| Some((&e.shape[..], e.covariance.as_ref()?)))
    }

    /// Uncertainty of the learnt terms: groups of terms that err together, by one standard deviation.
    pub fn errors(&self, statistic: Statistic) -> Vec<Vec<Term>> {
        let mut parts: BTreeMap<(u32, usize), Vec<Term>> = BTreeMap::new();
        for (shape, covariance) in self.learnt() {
            for (k, factor) in covariance.factors.iter().enumerate() {
                let part = parts.entry((covariance.fit, k)).or_default();
                for (term, mine) in by_term(shape, factor) {
                    if term.statistic == statistic && mine.iter().any(|c| *c != 0.0) {
                        part.push(Term { coefficients: mine.to_vec(), ..term.clone() });
                    }
                }
            }
        }
        parts.into_values().filter(|part| !part.is_empty()).collect()
    }

    /// Error of a measured depth by the known laws of the distance, m, as `correct` undoes them.
    pub fn law_m(&self, z: f64, session_s: f64, px_m: f64) -> f64 {
        let of = |id, name| self.parameter(id, name);
        let scale = of("depth-scale", "scale");
        let offset_px = of("disparity-offset", "offset_px");
        let warmth = of("thermal-drift", "time_constant_s").map(|tau| -(-session_s / tau).exp_m1());
        let drift = of("thermal-drift", "relative").zip(warmth).map(|(r, w)| 1.0 + r * w);
        if scale.or(offset_px).or(drift).is_none() {
            return 0.0;
        }
        let factor = scale.unwrap_or(1.0) * drift.unwrap_or(1.0);
        z - px_m / (px_m * factor / z - offset_px.unwrap_or(0.0))
    }

    /// Coefficient of a known law of the distance; a law fitted to references undoes it by minus this.
    pub fn law(&self, family: &str) -> Option<f64> {
        match family {
            "depth-scale" => self.parameter(family, "scale").map(|scale| 1.0 - scale.recip()),
            "disparity-offset" => self.parameter(family, "offset_px"),
            _ => self.parameter(family, "relative"),
        }
    }

    /// Independent errors of the learnt terms' coefficients beyond [`KnownTerms::errors`]: one standard
    /// deviation of each. Profiles of single lines are excluded.
    pub fn own_errors(&self, statistic: Statistic) -> Vec<Term> {
        let fitted = self.learnt().filter(|(_, c)| !c.factors.is_empty());
        let of = |(shape, covariance): (&[Term], &Covariance)| -> Vec<Term> {
            let terms = by_term(shape, &covariance.variances);
            let rooted = terms.map(|(t, mine)| Term {
                coefficients: mine.iter().map(|v| v.sqrt()).collect(),
                ..t.clone()
            });
            let any = |t: &Term| t.coefficients.iter().any(|c| *c > 0.0);
            rooted.filter(|t| t.statistic == statistic && any(t)).collect()
        };
        fitted.flat_map(of).collect()
    }

    /// Error variance of the learnt profiles of single columns, or of single rows, px^2.
    pub fn error_of_lines_px2(&self, axis: Axis) -> f64 {
        let of = |(shape, covariance): (&[Term], &Covariance)| -> f64 {
            by_term(shape, &covariance.variances)
                .filter(|(term, _)| term.basis.axis() == axis)
                // Coefficients that were never learnt have no error.
                .filter_map(|(_, mine)| mean(mine.iter().copied().filter(|v| *v > 0.0)))
                .sum()
        };
        self.learnt().filter(|(_, c)| c.factors.is_empty()).map(of).sum()
    }

    pub fn has(&self, id: &str) -> bool {
        self.entry(id).is_some()
    }

    fn entry(&self, id: &str) -> Option<&Effect> {
        self.effects.iter().find(|known| known.id == id)
    }

    /// Parameters of an effect as text.
    pub fn in_words(&self, id: &str) -> String {
        let entry = self.entry(id).into_iter();
        let numbers =
            entry.flat_map(|e| e.parameters.keys().filter_map(|n| Some((n, e.number(n)?))));
        numbers.map(|(name, value)| format!("{name} {value:.4}")).collect::<Vec<_>>().join(", ")
    }

    /// Standard error of a parameter; 0 where the model states none.
    pub fn std_error(&self, id: &str, name: &str) -> f64 {
        let of = |e: &Effect| e.parameters.get(name)?.get("std_error")?.as_f64();
        self.entry(id).and_then(of).unwrap_or(0.0)
    }

    /// A parameter of an effect.
    pub fn parameter(&self, id: &str, name: &str) -> Option<f64> {
        self.entry(id)?.number(name)
    }
}

/// Share of the ray's excess over the depth that these terms hold.
pub fn ray_share<'a>(terms: impl IntoIterator<Item = &'a Term>) -> f64 {
    let of_rays = terms.into_iter().filter(|t| t.basis == RAY_FOR_DEPTH);
    of_rays.map(|t| t.coefficients[0]).sum()
}

#[cfg(test)]
#[path = "known_tests.rs"]
mod tests;
