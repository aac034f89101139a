//! Selects the candidate of a step: a name that explains as much as any, or the best curve.

use super::candidate::{Candidate, RECALIBRATE};
use super::layer_null::{Group, LayerNull};
use super::outcome::{Chosen, Rival};
use super::rules::Rules;
use super::trial::Judged;
use crate::diagnose::finding::naming::{ln_occam, ln_odds};
use crate::terms::Basis;

/// Families within this gain of the best predict as well as it, nats; of these the one with the fewest
/// columns is taken.
const AS_GOOD_NATS: f64 = 2.0;
/// The same as a share of a large gain: no family's shape is exact.
const AS_GOOD_SHARE: f64 = 0.01;
/// Cap on a formula's relative error; one that is off by more is another formula.
const FORMULA_ERROR: f64 = 0.1;

/// Largest gap to the best gain, nats, at which a family predicts as well.
pub fn as_good(best: f64) -> f64 {
    AS_GOOD_NATS.max(AS_GOOD_SHARE * best)
}

/// Gain over the root of the dispersion, so that a candidate whose fits to single views disagree ranks
/// lower. Two standard errors of a mean square of so many numbers are allowed for: one here, and one
/// already subtracted from `dispersion`.
pub fn corrected(gain: f64, dispersion: f64, numbers: usize) -> f64 {
    let clear = (dispersion - f64::sqrt(2.0 / numbers as f64)).max(1.0);
    if gain > 0.0 { gain / clear.sqrt() } else { gain }
}

/// The candidates of a step and their assessments.
pub struct Choice<'a> {
    pub candidates: &'a [Candidate],
    pub judged: &'a [Option<Judged>],
    pub rules: &'a Rules,
    pub noise: &'a LayerNull,
}

impl Choice<'_> {
    /// Returns the best candidate, if its gain exceeds the noise threshold and it is not among the
    /// `chosen` already.
    pub fn best(&self, chosen: &[Chosen]) -> Option<Chosen> {
        let families = self.ranked(true, |i| self.dispersion_corrected_gain(i));
        let curves = self.ranked(false, |i| self.total(i));
        let new = |i: usize| {
            !chosen.iter().any(|c| same_curve(&c.candidate, &self.candidates[i]))
                && self.is_sensible(i)
        };
        let agreed =
            self.rules.agreed.then(|| self.ranked(false, |i| self.dispersion_corrected_gain(i)));
        let curve = || {
            let ranked = agreed.as_ref().unwrap_or(&curves);
            let mut clear = ranked.iter().copied().filter(|&i| self.is_significant(i) && new(i));
            let best = clear.next()?;
            // A curve over one coordinate goes first; the rest of the map is looked for next.
            let is_map = |i: usize| matches!(self.candidates[i].basis, Basis::Map { .. });
            let as_much = |i: usize| self.total(i) > CLEAR * self.total(best);
            let is_curve = |i: usize| {
                matches!(self.candidates[i].basis, Basis::Curve { .. } | Basis::Ring { .. })
            };
            let simpler = is_map(best).then(|| clear.find(|&i| is_curve(i) && as_much(i)));
            Some(simpler.flatten().unwrap_or(best))
        };
        let winner = self.name(&families, &curves).or_else(curve)?;
        Some(Chosen {
            candidate: self.candidates[winner].clone(),
            rms: self.judged[winner].as_ref().map_or(0.0, |j| j.rms),
            adequacy: self.adequacy(winner),
            gain: self.total(winner),
            best_curve: self.best_curve(&curves),
            rivals: self.rivals(winner, &families)?,
            p: self.noise.p(self.group(winner), self.calibrated_gain(winner)),
        })
    }

    fn total(&self, i: usize) -> f64 {
        self.judged[i].as_ref().map_or(f64::NEG_INFINITY, |j| j.gain.total)
    }

    fn calibrated_gain(&self, i: usize) -> f64 {
        self.judged[i].as_ref().map_or(0.0, |j| j.calibrated_gain(self.rules))
    }

    fn group(&self, i: usize) -> Group {
        Group::of(&self.candidates[i])
    }

    /// Whether noise alone hardly brings as much.
    fn is_significant(&self, i: usize) -> bool {
        self.calibrated_gain(i) > self.noise.threshold(self.group(i), self.rules.level)
    }

    /// See [`corrected`].
    fn dispersion_corrected_gain(&self, i: usize) -> f64 {
        self.judged[i].as_ref().map_or(f64::NEG_INFINITY, |j| {
            let numbers = j.gain.by_view.len() * self.candidates[i].basis.count();
            corrected(j.gain.total, j.null.dispersion, numbers)
        })
    }

    /// Whether it explains as much as the best, and the views differ from it by second-order errors of
    /// its formula rather than by noise. Their dispersion then does not count against it.
    fn is_as_exact_as_a_formula(&self, i: usize, most: f64) -> bool {
        let (total, candidate) = (self.total(i), &self.candidates[i]);
        let Some(judged) = &self.judged[i] else { return false };
        let error = candidate.formula_error().min(FORMULA_ERROR);
        let numbers = (judged.gain.by_view.len() * candidate.basis.count()) as f64;
        total > (1.0 - AS_GOOD_SHARE) * most && 2.0 * total * error.powi(2) > numbers
    }

    fn is_sensible(&self, i: usize) -> bool {
        self.judged[i].as_ref().is_some_and(|j| j.sensible)
    }

    /// Candidates with or without a name, best first.
    fn ranked(&self, named: bool, by: impl Fn(usize) -> f64) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.candidates.len())
            .filter(|&i| self.candidates[i].family.is_some() == named)
            .collect();
        order.sort_by(|&a, &b| by(b).total_cmp(&by(a)));
        order
    }

    fn best_curve(&self, curves: &[usize]) -> f64 {
        curves.first().map_or(f64::NEG_INFINITY, |&i| self.total(i))
    }

    /// Name to take, if any: of those as good as the best, the family with the fewest columns, by its simplest
    /// significant shape.
    fn name(&self, families: &[usize], curves: &[usize]) -> Option<usize> {
        let best_family =
            families.first().map_or(f64::NEG_INFINITY, |&i| self.dispersion_corrected_gain(i));
        let most = families.iter().map(|&i| self.total(i)).fold(0.0, f64::max);
        let slack = as_good(best_family);
        let columns = |i: usize| self.candidates[i].basis.count();
        let simplest = |all: &mut dyn Iterator<Item = usize>| {
            all.min_by_key(|&i| (columns(i), !self.rests_on_a_measurement(i)))
        };
        let as_good = || {
            families.iter().copied().filter(|&i| {
                self.dispersion_corrected_gain(i) > best_family - slack
                    || self.is_as_exact_as_a_formula(i, most)
            })
        };
        let family = self.candidates[simplest(&mut as_good())?].family;
        // A family's simplest shape may be too weak where a wider one of it is not. Of those with as few columns
        // the steadiest may explain too little.
        let own = |&i: &usize| self.candidates[i].family == family && self.is_significant(i);
        let fewest = as_good().filter(own).map(columns).min()?;
        as_good()
            .filter(own)
            .filter(|&i| columns(i) == fewest)
            .find(|&i| self.explains_enough(i, curves))
    }

    /// Whether a name explains enough of what nameless curves do, and the views do not speak against it.
    fn explains_enough(&self, i: usize, curves: &[usize]) -> bool {
        let (total, best_curve) = (self.total(i), self.best_curve(curves));
        let columns = |i: usize| self.candidates[i].basis.count();
        let axis = |k: usize| self.candidates[k].basis.axis();
        let own = curves.iter().copied().find(|&k| axis(k) == axis(i));
        let least = own.map_or(0.0, |k| self.rules.own_axis_adequacy * self.total(k).max(0.0));
        // A name with a lower adequacy of its own may ride on another cause's error.
        let alone = self.adequacy(i) >= self.rules.adequacy;
        // A nameless curve with fewer columns and a larger gain speaks against the name.
        let simpler = |&k: &usize| columns(k) < columns(i) && self.total(k) > total;
        let steady = || self.judged[i].as_ref().is_some_and(consistent_across_views);
        total > self.adequacy(i) * best_curve
            && (!alone || total > least)
            && !curves.iter().any(simpler)
            && self.is_sensible(i)
            && (total > CLEAR * best_curve || steady())
    }

    /// The best of each family: for the winner's the shape with the largest gain, for the others the
    /// most probable one given its number of columns.
    fn rivals(&self, winner: usize, families: &[usize]) -> Option<Vec<Rival>> {
        let won = &self.judged[winner].as_ref()?.gain;
        let own = self.candidates[winner].family;
        let columns = |i: usize| self.candidates[i].basis.count() as f64;
        let odds =
            |i: usize| ln_odds(self.dispersion_corrected_gain(i)) + ln_occam(columns(i), won.total);
        let mut best: Vec<(&'static str, usize)> = Vec::new();
        for &i in families.iter().filter(|&&i| self.judged[i].is_some()) {
            let Some(family) = self.candidates[i].family else { continue };
            match best.iter_mut().find(|b| b.0 == family) {
                None => best.push((family, i)),
                Some(b) if Some(family) != own && odds(i) > odds(b.1) => b.1 = i,
                Some(_) => {}
            }
        }
        let rival = |(family, i): (&'static str, usize)| {
            Some(Rival {
                family,
                basis: self.candidates[i].basis.clone(),
                gain: self.dispersion_corrected_gain(i),
                behind: behind(&won.by_view, &self.judged[i].as_ref()?.gain.by_view),
            })
        };
        let mut rivals: Vec<Rival> = best.into_iter().filter_map(rival).collect();
        rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        Some(rivals)
    }

    /// Whether its axis was measured for its own sake, as ambient light is; the light of the surface
    /// comes from an image that ambient light brightens too.
    fn rests_on_a_measurement(&self, i: usize) -> bool {
        self.candidates[i].effect().is_some_and(|e| e.card().rests_on_a_measurement)
    }

    /// Share of the best curve's gain that a name must reach. It is higher for the sigma model, whose
    /// columns fit nearly anything that varies with distance.
    fn adequacy(&self, i: usize) -> f64 {
        let candidate = &self.candidates[i];
        if candidate.family == Some(RECALIBRATE) {
            return LAW_ADEQUATE.max(self.rules.adequacy);
        }
        let own = candidate.effect().and_then(|e| e.card().must_explain);
        own.map_or(self.rules.adequacy, |share| share.min(self.rules.adequacy))
    }
}

/// Whether both are the same nameless curve, perhaps with other nodes.
fn same_curve(a: &Candidate, b: &Candidate) -> bool {
    let key = |c: &Candidate| match c.basis {
        // A step and a smooth curve are not the same.
        Basis::Curve { over, times, nodes, .. } => Some((format!("{over:?}{}", nodes == 2), times)),
        Basis::Map { times, .. } => Some(("map".to_string(), times)),
        _ => None,
    };
    let both_nameless = a.family.is_none() && b.family.is_none();
    both_nameless && (a.basis == b.basis || key(a).is_some_and(|k| Some(k) == key(b)))
}

/// See [`Choice::adequacy`].
const LAW_ADEQUATE: f64 = 0.85;
/// A name with this share of the best nameless curve's gain needs no agreement between views; a curve
/// with this share of a map's gain is preferred to it.
const CLEAR: f64 = 0.85;

/// Whether the views agree on a name: where they scatter about the common fit far beyond their noise,
/// it must help most of them.
fn consistent_across_views(judged: &Judged) -> bool {
    const WILD: f64 = 3.0;
    const STEADY: f64 = 2.5;
    judged.null.dispersion < WILD || over_error(&judged.gain.by_view) > STEADY
}

/// Mean difference over the views, divided by its standard error.
pub fn behind(winner: &[f64], rival: &[f64]) -> f64 {
    over_error(&winner.iter().zip(rival).map(|(w, r)| w - r).collect::<Vec<f64>>())
}

/// Mean, divided by its standard error; zero where the values do not scatter.
pub fn over_error(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    if variance > 0.0 { mean / (variance / n).sqrt() } else { 0.0 }
}

#[cfg(test)]
#[path = "choose_tests.rs"]
mod tests;
