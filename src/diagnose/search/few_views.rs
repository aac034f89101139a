//! Causes that show in a few of the views and not in the others.
//!
//! A fit to all views misses a cause that only some of them have: the others outvote it. So each
//! candidate is also fitted to the views that show it best, one, two, up to nearly half of them. The
//! choice costs the logarithm of the number of such sets.

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use statrs::function::factorial::ln_binomial;

use super::candidate::{Candidate, RECALIBRATE};
use super::each_view::EachView;
use super::evidence::{self, Evidence, root};
use super::noise_gains::{MIN_EXCESS, NoiseGains};
use super::outcome::Outcome;
use super::rules::Rules;
use crate::diagnose::diagnosis::Finding;
use crate::diagnose::finding::along::Along;
use crate::diagnose::finding::other_findings::of_names;
use crate::diagnose::finding::pixels::terms_of;
use crate::diagnose::finding::scene::{Scene, size};
use crate::diagnose::views::samples::ViewData;
use crate::rng::{Seed, Stream};
use crate::solve::Cholesky;
use crate::stats::quantile;
use crate::terms::{Basis, Term};

/// Candidates with more columns fit single views too freely.
const MAX_COLUMNS: usize = 16;
/// Simulations of the null; its tail is taken as exponential.
const REPLICATES: u64 = 200;
/// Largest ratio of the shared terms' gain to that of a cause in a few views; beyond it, the cause is a
/// misfit of the shared terms' shape.
const BESIDE_ALL: f64 = 10.0;
/// Share of the best gain that a name must reach; a few views show little of a shape.
const NAME_ADEQUATE: f64 = 0.9;
/// A name must also bring this multiple of a nameless cause's gain in all views: a right one brought
/// 4.6 times as much, wrong ones the same and less (three trials, three seeds of another hand).
const BESIDE_NAMELESS: f64 = 3.0;

/// Share of its gain that a name must bring where each view is predicted from the others: views with one cause
/// lose a few columns' cost, views with errors of their own have nothing to predict.
const PREDICTED: f64 = 0.5;

/// Views that do not predict one another have a cause where no other comes near: the best of the others brings
/// less than the threshold, or at most this share of their gain. Where all views have errors of their own (a
/// warp of 0.005 px in each), it brings a quarter to a half.
const APART: f64 = 0.1;

/// A candidate fitted to the views that show it best.
struct Best {
    /// Gain of a common fit to them, less the cost of choosing them and of the columns, nats.
    gain: f64,
    views: Vec<usize>,
    beta: DVector<f64>,
    /// Whether they predict one another; a single view predicts nothing.
    agreed: bool,
    /// Gain of the best of the others alone, nats.
    next: f64,
}

impl Best {
    /// Whether these views, and no others, have a cause; `threshold` is that of a gain.
    fn is_cause(&self, threshold: f64) -> bool {
        self.agreed || self.next < f64::max(threshold, APART * self.gain)
    }
}

/// One candidate's evidence, view by view, divided by the views' dispersion.
struct Tried<'a> {
    candidate: &'a Candidate,
    evidence: Vec<Evidence>,
    factors: Vec<DMatrix<f64>>,
    prior: f64,
}

/// Best common fit of these columns to a few views.
fn best(views: &[Evidence], prior: f64) -> Option<Best> {
    let (n, k) = (views.len(), views.first()?.b.len());
    let fit = |e: &Evidence| {
        let beta = evidence::fit(std::slice::from_ref(e), prior)?;
        Some((0.5 * beta.dot(&e.b), beta))
    };
    let mut order = Vec::with_capacity(n);
    for (v, e) in views.iter().enumerate() {
        order.push((fit(e)?.0, v));
    }
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut sum = Evidence::zeros(k);
    let mut best: Option<Best> = None;
    for count in 1..=(n - 1) / 2 {
        let next = &views[order[count - 1].1];
        sum.a += &next.a;
        sum.b += &next.b;
        let (nats, beta) = fit(&sum)?;
        let gain = nats - ln_binomial(n as u64, count as u64) - 0.5 * k as f64;
        if best.as_ref().is_none_or(|b| gain > b.gain) {
            let views = order[..count].iter().map(|o| o.1).collect();
            let next = order[count].0 - (n as f64).ln() - 0.5 * k as f64;
            best = Some(Best { gain, views, beta, agreed: false, next });
        }
    }
    best
}

impl<'a> Tried<'a> {
    /// `excess` is the factor on all views' variance, where the model was learnt from other views.
    fn of(
        candidate: &'a Candidate,
        evidence: Vec<Evidence>,
        prior: f64,
        excess: f64,
    ) -> Option<Self> {
        let k = candidate.basis.count();
        let mut ratios = Vec::new();
        for e in &evidence {
            let inverse = Cholesky::of(&e.a + DMatrix::identity(k, k) * prior)?.inverse();
            // One view may show few of the columns, or hardly: a sum of chi squared with these weights
            // (Satterthwaite 1946).
            let shown = &e.a * &inverse;
            let (weight, squares) = (shown.trace(), (&shown * &shown).trace());
            if weight >= 0.5 {
                let freedom = weight * weight / squares;
                let quarter = ChiSquared::new(freedom).ok()?.inverse_cdf(0.25) * squares / weight;
                ratios.push(e.b.dot(&(inverse * &e.b)) / quarter);
            }
        }
        // The lowest quarter of the views is noise even if nearly half of them have the cause.
        let usual = quantile(&mut ratios, 0.25).unwrap_or(0.0);
        let scatter = excess * usual.max(1.0);
        // Only the evidence is scaled: the cost of choosing the views is paid in full.
        let evidence: Vec<Evidence> =
            evidence.iter().map(|e| Evidence { a: &e.a / scatter, b: &e.b / scatter }).collect();
        let factors = evidence.iter().map(|e| root(&e.a)).collect();
        Some(Tried { candidate, evidence, factors, prior })
    }

    fn best(&self) -> Option<Best> {
        let found = best(&self.evidence, self.prior)?;
        let mine: Vec<Evidence> = found.views.iter().map(|&v| self.evidence[v].clone()).collect();
        let whole: f64 = mine.iter().map(|e| 0.5 * found.beta.dot(&e.b)).sum();
        let predicted = evidence::gain(&mine, self.prior)?.total;
        Some(Best { agreed: predicted > PREDICTED * whole, ..found })
    }

    /// Draws the gain of pure noise.
    fn draw(&self, rng: &mut Stream) -> f64 {
        let noise = |(e, root): (&Evidence, &DMatrix<f64>)| {
            let white = DVector::from_fn(root.ncols(), |_, _| StandardNormal.sample(rng));
            Evidence { a: e.a.clone(), b: root * white }
        };
        let evidence: Vec<Evidence> = self.evidence.iter().zip(&self.factors).map(noise).collect();
        best(&evidence, self.prior).map_or(0.0, |b| b.gain)
    }
}

/// Strongest cause of a few views beside the terms that all share, if its gain exceeds the noise
/// threshold. `excess` is the factor by which each view's variance exceeds what its samples imply,
/// where lines or views err alike.
pub fn few_views(
    scene: &Scene<'_>,
    fine: &[ViewData],
    candidates: &[Candidate],
    outcome: &Outcome,
    rules: &Rules,
    excess: &[f64],
    seed: Seed,
) -> Option<Finding> {
    let each = EachView::of(scene, fine, &terms_of(outcome, scene.statistic), excess);
    let views = each.prepared(rules.prior);
    let left_open = rules.learnt_from.map_or(1.0, |model| model.excess(fine.len() as f64));
    let tried: Vec<Tried<'_>> = candidates
        .par_iter()
        .filter(|c| c.family != Some(RECALIBRATE) && c.basis.count() <= MAX_COLUMNS)
        // Seams are many, and nearly the same.
        .filter(|c| c.family.is_some() || !matches!(c.basis, Basis::Curve { nodes: 2, .. }))
        .filter_map(|c| Tried::of(c, views.evidence(&c.basis)?, rules.prior, left_open))
        .collect();
    let mut all: Vec<(&Candidate, Best)> =
        tried.par_iter().filter_map(|t| Some((t.candidate, t.best()?))).collect();
    all.retain(|(candidate, best)| candidate.agrees(best.beta.as_slice()));
    all.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
    let most = all.first()?.1.gain;
    let shared: f64 = outcome.chosen.iter().map(|c| c.gain.max(0.0)).sum();
    // Views other than those a model was learnt from differ for reasons of their own.
    let beside_all = if rules.learnt_from.is_some() { 1.0 } else { BESIDE_ALL };
    if most * beside_all < shared {
        return None;
    }
    let noise = NoiseGains::simulated(REPLICATES, MIN_EXCESS, |replicate| {
        let mut rng = seed.stream(&format!("few-views/null/{replicate}"));
        tried.iter().map(|t| t.draw(&mut rng)).fold(f64::NEG_INFINITY, f64::max)
    });
    let threshold = noise.threshold(rules.level);
    if most < threshold {
        return None;
    }
    let nameless = outcome.chosen.iter().filter(|c| c.candidate.family.is_none());
    let (told, names) = told(&all, nameless.map(|c| c.gain).fold(0.0, f64::max))?;
    let best = &told.1;
    best.is_cause(threshold).then(|| report(scene, told, &names, noise.p(best.gain)))
}

/// No name is reported if more than these explain it.
const MAX_NAMES: usize = 3;

/// Returns the candidate to report, of all sorted best first, and the names it may have, none for a
/// curve. Much looks alike in a few views, so a name must beat nameless curves on other axes, and its views
/// must agree. It must also clearly beat `nameless`, the gain of a nameless cause in all views, whose misfit
/// in some of them may look like anything. The noise level of one view fits every cause that changes the noise.
fn told<'a>(
    all: &'a [(&'a Candidate, Best)],
    nameless: f64,
) -> Option<(&'a (&'a Candidate, Best), Vec<&'static str>)> {
    let first = all.first()?;
    let most = first.1.gain;
    let curves = || all.iter().filter(|(c, _)| c.family.is_none());
    let clear = |(c, b): &&(&Candidate, Best)| {
        let mut others = curves().filter(|o| o.0.basis.axis() != c.basis.axis());
        others.all(|o| o.1.gain < NAME_ADEQUATE * b.gain)
    };
    let adequate = f64::max(NAME_ADEQUATE * most, BESIDE_NAMELESS * nameless);
    let named = || all.iter().filter(|(c, b)| c.family.is_some() && b.agreed && b.gain > adequate);
    let mut names: Vec<&'static str> = Vec::new();
    for family in named().filter_map(|(c, _)| c.family) {
        if !names.contains(&family) {
            names.push(family);
        }
    }
    if let Some(found) = named().next().filter(clear).filter(|_| names.len() <= MAX_NAMES) {
        return Some((found, names));
    }
    let curve = curves().next().filter(|(_, b)| b.gain > NAME_ADEQUATE * most);
    Some((curve.unwrap_or(first), Vec::new()))
}

fn report(
    scene: &Scene<'_>,
    (candidate, best): &(&Candidate, Best),
    names: &[&'static str],
    p: f64,
) -> Finding {
    let (statistic, axis) = (scene.statistic, candidate.basis.axis());
    let coefficients = best.beta.as_slice().to_vec();
    let term = Term { statistic, basis: candidate.basis.clone(), coefficients };
    let mut values = scene.values(std::slice::from_ref(&term));
    let others = (0..values.len()).filter(|v| !best.views.contains(v)).collect::<Vec<_>>();
    others.into_iter().for_each(|v| values[v].iter_mut().for_each(|x| *x = 0.0));
    let mut views: Vec<&str> =
        best.views.iter().map(|&v| scene.survey.views[v].name.as_str()).collect();
    views.sort_unstable();
    let only = format!("only in the views {}", views.join(", "));
    let along = Along::of(scene, &candidate.basis);
    let mut finding = Finding {
        interval: along.interval(scene, &values),
        share: best.gain,
        size: size(scene, &values),
        p_adjusted: Some(p),
        of_some: Some([best.views.len(), scene.survey.views.len()]),
        ..of_names(names, statistic, axis, Some(only.clone()))
    };
    if finding.effect.is_some() {
        finding.physics += &format!(" It shows {only}.");
    }
    finding
}

#[cfg(test)]
#[path = "few_views_tests.rs"]
mod tests;
