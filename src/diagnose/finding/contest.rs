//! Names in doubt, and the chance that one more view settles them.
//!
//! The view is simulated as the search will see it, by its normal equations A. One of the causes in
//! doubt is drawn, with coefficients from their posterior; the scores are A beta plus noise with the
//! dispersion of the views taken. Then all names are weighed again. The share of draws in which the true
//! name becomes sure is the chance that the view settles it (preposterior analysis: Raiffa and Schlaifer
//! 1961). A cause whose lead over a rival on the views taken is too small is not the only one there, or
//! does not follow its formula: it settles nothing.

use nalgebra::{DMatrix, DVector};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::naming::{MIN_PROBABILITY, naming, temper};
use super::pixels::terms_of;
use crate::diagnose::diagnosis::Alternative;
use crate::diagnose::search::candidate::{Candidate, RECALIBRATE};
use crate::diagnose::search::choose::{as_good, behind, corrected};
use crate::diagnose::search::evidence::{Evidence, Gain, gain, root};
use crate::diagnose::search::layer_search::{BIAS_PRIOR, VARIANCE_PRIOR};
use crate::diagnose::search::null::Null;
use crate::diagnose::search::outcome::{Chosen, Outcome, Rival};
use crate::diagnose::search::prepared::evidence_of_bases;
use crate::diagnose::views::samples::ViewData;
use crate::rng::Stream;
use crate::terms::{Basis, Statistic, Term};

/// A name this probable needs no further view.
pub const SURE: f64 = 0.9;
/// Draws of a view: a chance of one half has a standard error of .03.
const DRAWS: usize = 250;
/// Standard errors by which a cause's lead over a rival may fall short of the expected one.
const SHORT: f64 = 2.0;

/// The names in doubt, on the views taken.
pub struct Contest<'a> {
    chosen: &'a Chosen,
    /// The most probable first.
    pub names: Vec<Name<'a>>,
    /// Basis functions fitted with every name, then those of the names.
    pub bases: Vec<&'a Basis>,
    /// Information of the views taken, on the columns of `bases`.
    pub information: DMatrix<f64>,
    beside: Vec<usize>,
    /// The views taken, on the columns `beside` only.
    base: Vec<Evidence>,
    prior: f64,
    /// Probability of each name on the views taken, and of none of them, as weighed here: on coarser samples
    /// than the search's and given what it found.
    pub now: Vec<f64>,
    /// Whether each name leads every rival by as much as it should.
    borne_out: Vec<bool>,
}

pub struct Name<'a> {
    pub family: &'static str,
    basis: &'a Basis,
    probability: f64,
    /// Columns beside it, then its own.
    columns: Vec<usize>,
    /// The views taken, on these columns.
    views: Vec<Evidence>,
    fit: Gain,
    /// Root of its coefficients' covariance, with the dispersion of the views.
    root: DMatrix<f64>,
    /// Dispersion of the views about its fit.
    scatter: f64,
    /// Relative error of its formula.
    formula_error: f64,
}

/// Evidence on these columns only.
fn part(e: &Evidence, columns: &[usize]) -> Evidence {
    let a = e.a.select_rows(columns).select_columns(columns);
    Evidence { a, b: e.b.select_rows(columns) }
}

impl<'a> Contest<'a> {
    /// Contest between the names `stated` of a finding that began with `chosen`. All other terms, except a
    /// refit of sigma, are subtracted from `data` as fitted. `None` with fewer than two names.
    pub fn of(
        (statistic, data): (Statistic, &[ViewData]),
        outcome: &'a Outcome,
        chosen: &'a Chosen,
        stated: &[Alternative],
    ) -> Option<Self> {
        let is_law = |c: &&Chosen| c.candidate.family == Some(RECALIBRATE);
        let mut bases: Vec<&Basis> =
            outcome.chosen.iter().filter(is_law).map(|c| &c.candidate.basis).collect();
        let others = (0..outcome.chosen.len()).filter(|&k| {
            let c = &outcome.chosen[k];
            // The part of the chosen that planes absorb goes with it.
            let is_gauge = matches!(c.candidate.basis, Basis::Affine { .. });
            let of_chosen = |c| std::ptr::eq(c, chosen);
            let is_own = of_chosen(c) || is_gauge && k > 0 && of_chosen(&outcome.chosen[k - 1]);
            !is_own && !is_law(&c)
        });
        let terms = terms_of(outcome, statistic);
        let settled: Vec<Term> = others.map(|k| terms[k].clone()).collect();
        let left = |view: &ViewData| ViewData { response: view.without(&settled), ..view.clone() };
        let data: Vec<ViewData> = data.par_iter().map(left).collect();
        let beside: Vec<usize> = (0..bases.iter().map(|b| b.count()).sum()).collect();
        let in_doubt = stated.iter().filter_map(|a| {
            let rival = chosen.rivals.iter().find(|r| r.family == a.effect)?;
            Some((rival, a.probability?))
        });
        let mut in_doubt: Vec<(&Rival, f64)> = in_doubt.collect();
        in_doubt.sort_by(|a, b| b.1.total_cmp(&a.1));
        bases.extend(in_doubt.iter().map(|(rival, _)| &rival.basis));
        let taken = evidence_of_bases(&data, &bases);
        let prior = if statistic == Statistic::Bias { BIAS_PRIOR } else { VARIANCE_PRIOR };
        let mut first = beside.len();
        let name = |(rival, probability): (&'a Rival, f64)| {
            let next = first + rival.basis.count();
            let columns: Vec<usize> = beside.iter().copied().chain(first..next).collect();
            first = next;
            let views: Vec<Evidence> = taken.iter().map(|e| part(e, &columns)).collect();
            let fit = gain(&views, prior)?;
            let scatter = Null::of(&views, beside.len(), prior)?.about_fit;
            let root = root(&(&fit.covariance * scatter));
            let Rival { family, ref basis, .. } = *rival;
            let formula_error = Candidate::named(family, basis.clone()).formula_error();
            Some(Name {
                family,
                basis,
                probability,
                columns,
                views,
                fit,
                root,
                scatter,
                formula_error,
            })
        };
        let names: Vec<Name<'_>> = in_doubt.into_iter().filter_map(name).collect();
        let columns = bases.iter().map(|b| b.count()).sum();
        let mut contest = Contest {
            chosen,
            names,
            information: Evidence::sum(columns, 0.0, &taken).a,
            base: taken.iter().map(|e| part(e, &beside)).collect(),
            bases,
            beside,
            prior,
            now: Vec::new(),
            borne_out: Vec::new(),
        };
        let gains = contest.gains(None)?;
        contest.now = contest.weigh(&gains)?;
        contest.borne_out =
            (0..contest.names.len()).map(|k| contest.is_borne_out(k, &gains)).collect();
        (contest.names.len() > 1).then_some(contest)
    }

    /// Whether name `k` leads every rival by as much as it should if it were true.
    fn is_borne_out(&self, k: usize, gains: &[(Gain, f64)]) -> bool {
        (0..self.names.len()).filter(|&r| r != k).all(|r| {
            // The variance of the gain is twice its expectation, times the dispersion of the views.
            let apart = self.apart(&self.information, &self.names[k], &self.names[r]);
            let error = (apart * self.names[k].scatter).sqrt();
            let slack = as_good(gains[k].0.total);
            gains[k].0.total - gains[r].0.total > 0.5 * apart - SHORT * error - slack
        })
    }

    /// Squared standard errors between a cause as fitted and the best fit of a rival to it.
    fn apart(&self, a: &DMatrix<f64>, truth: &Name<'_>, rival: &Name<'_>) -> f64 {
        let own = &truth.columns[self.beside.len()..];
        let beta = truth.fit.beta.rows(self.beside.len(), own.len()).into_owned();
        let of = |rows: &[usize], columns: &[usize]| a.select_rows(rows).select_columns(columns);
        let cross = of(&rival.columns, own) * &beta;
        let mut free = of(&rival.columns, &rival.columns);
        // Keeps columns without information from making the matrix singular.
        let floor = 1e-9 * free.diagonal().max().max(f64::MIN_POSITIVE);
        free.set_diagonal(&free.diagonal().add_scalar(floor));
        let absorbed = free.cholesky().map_or(0.0, |c| cross.dot(&c.solve(&cross)));
        (beta.dot(&(of(own, own) * &beta)) - absorbed).max(0.0)
    }

    /// Sum of these over all pairs, weighted by the probabilities of both names.
    pub fn all_apart(&self, a: &DMatrix<f64>) -> f64 {
        let pairs = self.names.iter().flat_map(|n| self.names.iter().map(move |m| (n, m)));
        pairs
            .filter(|(truth, rival)| truth.family != rival.family)
            .map(|(truth, rival)| {
                truth.probability * rival.probability * self.apart(a, truth, rival)
            })
            .sum()
    }

    /// Gain of each name on the views taken and one more, as it is and corrected for their dispersion.
    fn gains(&self, more: Option<&Evidence>) -> Option<Vec<(Gain, f64)>> {
        let gain_of = |taken: &[Evidence], columns: &[usize]| {
            let more = more.map(|e| part(e, columns));
            gain(&taken.iter().cloned().chain(more).collect::<Vec<_>>(), self.prior)
        };
        let base = gain_of(&self.base, &self.beside)?;
        let over_base = |name: &Name<'_>| {
            let gain = gain_of(&name.views, &name.columns)?.over(&base);
            let numbers = gain.by_view.len() * name.basis.count();
            let counts = corrected(gain.total, name.scatter, numbers);
            Some((gain, counts))
        };
        self.names.iter().map(over_base).collect()
    }

    /// Probability of each name given these gains, and of none of them.
    fn weigh(&self, gains: &[(Gain, f64)]) -> Option<Vec<f64>> {
        let best = gains.iter().map(|g| g.1).fold(f64::NEG_INFINITY, f64::max);
        if best <= 0.0 {
            let mut none = vec![MIN_PROBABILITY; self.names.len()];
            none.push(1.0 - none.iter().sum::<f64>());
            return Some(none);
        }
        let leads = (0..self.names.len())
            .filter(|&k| gains[k].1 > best - as_good(best))
            .min_by_key(|&k| self.names[k].basis.count())?;
        let rival = |(name, (gain, counts)): (&Name<'_>, &(Gain, f64))| Rival {
            family: name.family,
            basis: name.basis.clone(),
            gain: *counts,
            behind: behind(&gains[leads].0.by_view, &gain.by_view),
        };
        let (leader, gain) = (&self.names[leads], gains[leads].0.total);
        let (_, _, mut stated) = naming(&Chosen {
            candidate: Candidate::named(leader.family, leader.basis.clone()),
            gain,
            // The gain of a nameless curve grows in proportion.
            best_curve: self.chosen.best_curve / self.chosen.gain * gain.max(0.0),
            rivals: self.names.iter().zip(gains).map(rival).collect(),
            ..self.chosen.clone()
        });
        temper(&mut stated);
        let of_name = |name: &Name<'_>| {
            let stated = stated.iter().find(|a| a.effect == name.family);
            stated.and_then(|a| a.probability).unwrap_or(0.0).max(MIN_PROBABILITY)
        };
        let mut all: Vec<f64> = self.names.iter().map(of_name).collect();
        all.push((1.0 - all.iter().sum::<f64>()).max(MIN_PROBABILITY));
        Some(all)
    }

    /// Index of the name that one more view makes sure: the stated odds times the change by the view.
    pub fn sure_with(&self, more: &Evidence) -> Option<usize> {
        let none = 1.0 - self.names.iter().map(|n| n.probability).sum::<f64>();
        let stated = self.names.iter().map(|n| n.probability).chain([none]);
        let changed = self.weigh(&self.gains(Some(more))?)?;
        let changed = changed.iter().zip(&self.now).map(|(then, now)| then / now);
        let then: Vec<f64> = stated.zip(changed).map(|(p, factor)| p * factor).collect();
        let total: f64 = then.iter().sum();
        (0..self.names.len()).find(|&k| then[k] >= SURE * total)
    }

    /// Chance that a view with the information `a` makes the true name sure.
    pub fn chance(&self, a: &DMatrix<f64>, mut rng: Stream) -> f64 {
        let noise = root(a);
        let settled = (0..DRAWS).filter(|_| self.settles(a, &noise, &mut rng)).count();
        settled as f64 / DRAWS as f64
    }

    fn settles(&self, a: &DMatrix<f64>, noise: &DMatrix<f64>, rng: &mut Stream) -> bool {
        let mut left: f64 = rng.random();
        let drawn = self.names.iter().position(|name| {
            left -= name.probability;
            left < 0.0
        });
        // None of the names is true: no view settles it.
        let Some(drawn) = drawn else { return false };
        if !self.borne_out[drawn] {
            return false;
        }
        let truth = &self.names[drawn];
        let mut white = |n: usize| DVector::from_fn(n, |_, _| StandardNormal.sample(rng));
        let mut beta = &truth.fit.beta + &truth.root * white(truth.columns.len());
        // The error of its formula makes it larger or smaller in another view.
        let off = 1.0 + truth.formula_error * white(1)[0];
        beta.rows_mut(self.beside.len(), truth.basis.count()).scale_mut(off);
        let scores = a.select_columns(&truth.columns) * beta;
        let b = scores + noise * white(a.nrows()) * truth.scatter.sqrt();
        self.sure_with(&Evidence { a: a.clone(), b }) == Some(drawn)
    }

    /// Standard errors between the two best names, for views with this information.
    pub fn separation(&self, information: &DMatrix<f64>) -> f64 {
        self.apart(information, &self.names[0], &self.names[1]).sqrt()
    }
}
