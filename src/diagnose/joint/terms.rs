//! Decides on left-out views which terms the joint fit keeps, and whether it has smooth maps.

use nalgebra::{DMatrix, DVector};

use super::fit::{Joint, Reduced, SMOOTHNESS};
use crate::diagnose::search::candidate::Candidate;
use crate::diagnose::search::choose::{behind, over_error};
use crate::diagnose::search::outcome::Chosen;
use crate::stats::student_upper;
use crate::terms::{Axis, Basis, Coordinate, Statistic, Term};

/// Maps replace terms if they predict left-out views better by this share and by so many standard
/// errors over the folds.
const MAPS_SHARE: f64 = 0.02;
const MAPS_CLEARLY: f64 = 3.0;
/// Share of the total gain that a term must bring beside the maps, and by how many standard errors. For
/// waves, which maps only approximate, the latter is enough.
const TERM_SHARE: f64 = 0.005;
const TERM_CLEARLY: f64 = 2.0;
/// Largest size of a target shape beside the maps, in prior standard deviations (95 % lie within). Such
/// a shape, which a correction leaves in, must also bring `MAPS_SHARE`. One that is collinear with the
/// sensor's own error and fits no board is not the board's.
const LARGEST_USUAL: f64 = 2.0;
/// Share of the total gain that a smooth sensor error, such as the maps, must bring beside a target
/// shape. Less is a misfit of the target's formula (up to 2.1 % for domes, 0.7 % for arcs), which must
/// not be subtracted from other images.
const BESIDE_TARGET: f64 = 0.05;
/// Share of the total gain from which a radial name stays, with the maps as its remainder.
const RADIAL_NAME_ADEQUATE: f64 = 0.6;

/// The terms and maps that are kept.
pub struct Settled {
    pub terms: Vec<usize>,
    pub penalty: Option<DMatrix<f64>>,
    pub without: Vec<Reduced>,
    pub scores: Vec<f64>,
    /// Gain of the maps beside the terms, nats, and its p-value by Student's t over the folds.
    pub maps: f64,
    pub maps_p: f64,
}

/// A system to solve: the indices of its columns, and their prior precision.
pub struct System {
    pub columns: Vec<usize>,
    pub held: DMatrix<f64>,
}

impl Joint<'_> {
    /// System of the terms' columns in `kept`, and of the maps' where there are maps.
    pub fn system(&self, s: &Settled, kept: &[usize], precision: &DVector<f64>) -> System {
        let terms = self.columns.terms;
        let nodes = if s.penalty.is_some() { self.columns.nodes } else { 0 };
        let columns: Vec<usize> = kept.iter().copied().chain(terms..terms + nodes).collect();
        let mut held = DMatrix::zeros(columns.len(), columns.len());
        kept.iter().enumerate().for_each(|(i, &k)| held[(i, i)] = precision[k]);
        if let Some(penalty) = &s.penalty {
            held.view_mut((kept.len(), kept.len()), (nodes, nodes)).copy_from(penalty);
        }
        System { columns, held }
    }

    pub fn settle(&self, chosen: &[Chosen]) -> Option<Settled> {
        let everything: Vec<usize> = (0..chosen.len()).collect();
        let plain = self.without(&everything, None)?;
        let scores = self.scores(&plain, &everything, |_| true);
        let mut settled = Settled {
            scores,
            terms: everything,
            penalty: None,
            without: plain,
            maps: 0.0,
            maps_p: 1.0,
        };
        let is_kept = |t: &usize| !is_smooth_and_nameless(&chosen[*t].candidate);
        let kept: Vec<usize> = settled.terms.iter().copied().filter(is_kept).collect();
        if let Some(mapped) = self.best_maps(&kept) {
            let better = total(&mapped.scores) - total(&settled.scores);
            let slack = MAPS_SHARE * total(&mapped.scores);
            let clear = in_each_fold(&mapped.scores, &settled.scores) > MAPS_CLEARLY;
            // A remainder found by the search is left to the maps, unless they are worse.
            let seen = kept.len() < settled.terms.len();
            let alone = self.scores(&settled.without, &kept, |_| true);
            let brought = total(&mapped.scores) - total(&alone);
            let is_misfit = kept.iter().any(|&t| !is_of_sensor(&chosen[t].candidate))
                && brought < BESIDE_TARGET * total(&mapped.scores);
            if !is_misfit && ((clear && better > slack) || (seen && better > -slack)) {
                settled = mapped;
                self.drop_idle(&mut settled, chosen, total(&alone));
                settled.maps = total(&settled.scores) - total(&alone);
                let freedom = alone.len().saturating_sub(1).max(1) as f64;
                settled.maps_p = student_upper(behind(&settled.scores, &alone), freedom);
            }
        }
        if settled.penalty.is_none() {
            self.drop_misfit_of_target(&mut settled, chosen);
        }
        self.drop_companions(&mut settled, chosen);
        self.drop_harmful(&mut settled, chosen);
        Some(settled)
    }

    /// Smoothest maps that predict the left-out folds within one standard error of the best (Breiman et
    /// al. 1984).
    fn best_maps(&self, terms: &[usize]) -> Option<Settled> {
        let first = self.columns.terms;
        let diagonal = self.all.a.diagonal();
        let unit = diagonal.rows(first, self.columns.nodes / 2).mean();
        let mut all: Vec<Settled> = Vec::new();
        for smoothness in SMOOTHNESS {
            let penalty = self.columns.penalty(smoothness) * unit;
            let Some(without) = self.without(terms, Some(&penalty)) else { continue };
            let scores = self.scores(&without, terms, |_| true);
            let worse = all.last().is_some_and(|b| total(&b.scores) > total(&scores));
            if worse {
                break;
            }
            let (terms, penalty) = (terms.to_vec(), Some(penalty));
            all.push(Settled { terms, penalty, without, scores, maps: 0.0, maps_p: 1.0 });
        }
        let best = all.last()?.scores.clone();
        all.into_iter().find(|s| behind(&best, &s.scores) < 1.0)
    }

    /// Drops terms that the maps make redundant. `alone` is the terms' gain without the maps, nats.
    fn drop_idle(&self, settled: &mut Settled, chosen: &[Chosen], alone: f64) {
        let concerned = |s: &Settled, t: usize| {
            let c = &chosen[t].candidate;
            let named = alone > RADIAL_NAME_ADEQUATE * total(&s.scores);
            let waves = c.basis.period().is_some();
            waves || !(c.is_rough() || (named && is_radial_name(c)))
        };
        let needless = |s: &Settled, t: usize, lost: f64, scores: &[f64]| {
            let of_target = !is_of_sensor(&chosen[t].candidate);
            let share = match of_target {
                true => MAPS_SHARE,
                false if chosen[t].candidate.is_rough() => 0.0,
                false => TERM_SHARE,
            };
            let clear = behind(&s.scores, scores) > TERM_CLEARLY;
            let needed = lost > share * total(&s.scores) && clear;
            let believed = !of_target || self.size(s, t) < LARGEST_USUAL;
            !(needed && believed)
        };
        self.drop_while(settled, concerned, needless);
    }

    /// Drops smooth sensor errors that bring little beside a target shape.
    fn drop_misfit_of_target(&self, settled: &mut Settled, chosen: &[Chosen]) {
        if settled.terms.iter().all(|&t| is_of_sensor(&chosen[t].candidate)) {
            return;
        }
        let concerned = |_: &Settled, t: usize| {
            let c = &chosen[t].candidate;
            let smooth = is_radial_name(c) || c.family.is_none() && !c.basis.is_fine();
            smooth && is_of_sensor(c)
        };
        self.drop_while(settled, concerned, brings_less_than(BESIDE_TARGET));
    }

    /// Drops nameless curves that bring next to nothing beside a name on their own axis: a fit would
    /// split the effect between nearly collinear columns.
    fn drop_companions(&self, settled: &mut Settled, chosen: &[Chosen]) {
        let named: Vec<Axis> = settled
            .terms
            .iter()
            .map(|&t| &chosen[t].candidate)
            .filter(|c| c.family.is_some())
            .map(|c| c.basis.axis())
            .collect();
        let concerned = |_: &Settled, t: usize| {
            let c = &chosen[t].candidate;
            c.family.is_none() && named.contains(&c.basis.axis())
        };
        self.drop_while(settled, concerned, brings_less_than(TERM_SHARE));
    }

    /// Drops terms among the `concerned` that are `needless`, least missed first. `needless` gets the
    /// gain that the left-out folds lose without the term, nats, and their scores without it.
    fn drop_while(
        &self,
        settled: &mut Settled,
        concerned: impl Fn(&Settled, usize) -> bool,
        needless: impl Fn(&Settled, usize, f64, &[f64]) -> bool,
    ) {
        loop {
            let all = total(&settled.scores);
            let dropped = |&t: &usize| {
                let others = without(&settled.terms, t);
                let scores = self.scores(&settled.without, &others, |_| true);
                let lost = all - total(&scores);
                needless(settled, t, lost, &scores).then_some((lost, others, scores))
            };
            let next = settled
                .terms
                .iter()
                .filter(|&&t| concerned(settled, t))
                .filter_map(dropped)
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, others, scores)) = next else { return };
            (settled.terms, settled.scores) = (others, scores);
        }
    }

    /// Largest of a term's coefficients in prior standard deviations, averaged over the fits.
    fn size(&self, settled: &Settled, term: usize) -> f64 {
        let kept = self.kept(&settled.terms);
        let span = self.columns.span(term);
        let of = |beta: DVector<f64>| -> f64 {
            span.clone()
                .map(|k| self.columns.precision[k].sqrt() * beta[k].abs())
                .fold(0.0, f64::max)
        };
        let fits = settled.without.iter().filter_map(|r| r.fit(&kept, &self.columns.precision));
        fits.map(of).sum::<f64>() / settled.without.len().max(1) as f64
    }

    /// Drops terms until the sensor's alone, which a correction subtracts, help the left-out folds. A
    /// term needed only to offset one that is not the sensor's does not help.
    fn drop_harmful(&self, settled: &mut Settled, chosen: &[Chosen]) {
        let of_sensor = |t: usize| is_of_sensor(&chosen[t].candidate);
        while !settled.terms.is_empty() {
            if total(&self.scores(&settled.without, &settled.terms, of_sensor)) >= 0.0 {
                return;
            }
            let harm = |&t: &usize| {
                let others = without(&settled.terms, t);
                (total(&self.scores(&settled.without, &others, of_sensor)), others)
            };
            let best = settled.terms.iter().map(harm).max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, others)) = best else { return };
            settled.scores = self.scores(&settled.without, &others, |_| true);
            settled.terms = others;
        }
    }
}

/// The other terms.
fn without(terms: &[usize], term: usize) -> Vec<usize> {
    terms.iter().copied().filter(|t| *t != term).collect()
}

/// Criterion for dropping a term: the left-out folds lose less than this share without it.
fn brings_less_than(share: f64) -> impl Fn(&Settled, usize, f64, &[f64]) -> bool {
    move |settled, _, lost, _| lost < share * total(&settled.scores)
}

pub fn total(scores: &[f64]) -> f64 {
    scores.iter().sum()
}

/// Added to a fold's scores, as a share of the folds' mean: what a fold without evidence prefers is chance.
const LEAST_FOLD: f64 = 0.1;

/// How much better the winner is, in standard errors over the folds, where each fold's difference is a share of
/// its scores. A fold may hold ten times the evidence of another; in nats, its gain alone would make the mean
/// uncertain.
fn in_each_fold(winner: &[f64], rival: &[f64]) -> f64 {
    let pairs = || winner.iter().zip(rival);
    let size = |(w, r): (&f64, &f64)| w.abs() + r.abs();
    let least = LEAST_FOLD * pairs().map(size).sum::<f64>() / winner.len().max(1) as f64;
    let share = |(w, r): (&f64, &f64)| (w - r) / (size((w, r)) + least).max(f64::MIN_POSITIVE);
    over_error(&pairs().map(share).collect::<Vec<f64>>())
}

/// Whether the maps can express the same, and more.
pub fn is_smooth_and_nameless(c: &Candidate) -> bool {
    let still = matches!(
        c.basis,
        Basis::Map { .. } | Basis::Curve { over: Coordinate::Radius, nodes: 3.., .. }
    );
    c.family.is_none() && still
}

fn is_radial_name(c: &Candidate) -> bool {
    c.family.is_some() && c.basis.axis() == Axis::Radius
}

fn is_of_sensor(c: &Candidate) -> bool {
    let basis = c.basis.clone();
    Term { statistic: Statistic::Bias, basis, coefficients: Vec::new() }.is_sensor_bias()
}

#[cfg(test)]
#[path = "terms_tests.rs"]
mod tests;
