//! Greedy forward search for missing terms; each step is judged on held-out views against the null
//! distribution of the gain.

pub mod beside;
pub mod bias;
pub mod candidate;
pub mod choose;
mod each_view;
pub mod evidence;
pub mod few_views;
pub mod layer_null;
pub mod layer_search;
pub mod noise_gains;
pub mod null;
pub mod outcome;
mod period;
pub mod posterior;
pub mod prepared;
mod revise;
pub mod rows;
pub mod rules;
pub mod touched;
mod trial;
pub mod variance;
pub mod view_levels;
mod view_noise;
pub mod view_worth;

use std::rc::Rc;

use rayon::prelude::*;

use crate::diagnose::views::samples::ViewData;
use crate::rng::Seed;
use crate::terms::{Basis, Coordinate, Term};
use beside::Beside;
use candidate::Candidate;
use choose::Choice;
use evidence::{Evidence, fit, gain};
use layer_null::{Group, LayerNull};
use outcome::{Chosen, Look, Outcome, bases, bases_where};
use prepared::{Grouping, Prepared, Together, merge_by, prepare};
use rows::Rows;
use rules::Rules;
use trial::{Judged, Trial, looks, nests};

/// Smallest gain of a later term, as a share of the first term's; anything smaller is a misfit of the
/// first term's shape.
pub const MIN_SHARE_OF_GAIN: f64 = 0.005;

/// Searches a layer. `coarse` holds the same views in larger patches, for shapes that do not change
/// within them. The term `beside` is fitted together with every candidate, whatever its gain, so
/// nothing it can explain is attributed to another term. It is kept as the last of the chosen terms.
pub fn search(
    fine: &[ViewData],
    coarse: &[ViewData],
    candidates: &[Candidate],
    beside: Option<Candidate>,
    rules: &Rules,
    seed: Seed,
) -> Outcome {
    let mut layer = Layer::of(fine, coarse, candidates, rules, seed);
    let mut chosen: Vec<Chosen> = Vec::new();
    layer.pinned = beside.map(|candidate| layer.pin(candidate));
    while let Some(next) = layer.step(&chosen) {
        let little = chosen.first().is_some_and(|first| next.gain < MIN_SHARE_OF_GAIN * first.gain);
        if little || chosen.len() >= rules.max_terms {
            break;
        }
        layer.largest = layer.largest.max(next.rms);
        let nameless = next.candidate.family.is_none();
        if nameless && chosen.iter().all(|c| c.candidate.family.is_some()) {
            layer.look_back(&mut chosen);
        }
        chosen.push(next);
    }
    if chosen.iter().all(|c| c.candidate.family.is_some()) {
        layer.look_back(&mut chosen);
    }
    layer.refine_maps(&mut chosen);
    if rules.agreed {
        layer.drop_needless(&mut chosen);
    }
    let fit = |terms: &[Chosen]| gain(&layer.together.evidence(&bases(terms)), rules.prior);
    let (chosen, fit) = fitted_together(chosen, layer.pinned.clone(), fit);
    let evidence = layer.together.evidence(&bases(&chosen));
    let Layer { noise, looks, together, .. } = layer;
    drop(together);
    let (noise, evidence) = (noise.unwrap_or_default(), Rc::unwrap_or_clone(evidence));
    Outcome { chosen, looks, fit, evidence, noise, ..Outcome::default() }
}

/// Returns the terms that can be fitted together, in order of choice with the pinned one last, and
/// their fit. Between an error known to a millionth of a pixel and a prior of one pixel a fit runs out
/// of digits; a term that then cannot be fitted together with those before it is dropped.
fn fitted_together<T: Clone, F>(
    chosen: Vec<T>,
    pinned: Option<T>,
    fit: impl Fn(&[T]) -> Option<F>,
) -> (Vec<T>, Option<F>) {
    let all: Vec<T> = chosen.into_iter().chain(pinned).collect();
    let fitted = if all.is_empty() { None } else { fit(&all) };
    if all.is_empty() || fitted.is_some() {
        return (all, fitted);
    }
    let mut kept: (Vec<T>, Option<F>) = (Vec::new(), None);
    for term in all {
        let more: Vec<T> = kept.0.iter().cloned().chain([term]).collect();
        if let Some(fitted) = fit(&more) {
            kept = (more, Some(fitted));
        }
    }
    kept
}

struct Layer<'a> {
    together: Together<'a>,
    /// Groupings of each view's fine samples.
    groups: Vec<Vec<Grouping>>,
    candidates: &'a [Candidate],
    nests: Vec<Vec<usize>>,
    rules: &'a Rules,
    noise: Option<LayerNull>,
    looks: Vec<Look>,
    /// Root mean square of the largest term so far.
    largest: f64,
    /// Fitted together with every candidate.
    pinned: Option<Chosen>,
    seed: Seed,
}

impl<'a> Layer<'a> {
    fn of(
        fine: &'a [ViewData],
        coarse: &'a [ViewData],
        candidates: &'a [Candidate],
        rules: &'a Rules,
        seed: Seed,
    ) -> Self {
        Layer {
            together: Together::of(fine, coarse),
            groups: fine.par_iter().map(Grouping::all).collect(),
            candidates,
            nests: nests(candidates),
            rules,
            noise: None,
            looks: Vec::new(),
            largest: 0.0,
            pinned: None,
            seed,
        }
    }

    /// Prepares the views for the candidates. Named terms are refitted with every candidate; nameless
    /// ones have many columns and are subtracted as fitted.
    fn prepare(&self, chosen: &[Chosen]) -> Vec<Prepared<'_>> {
        let named = bases_where(chosen, |c| c.family.is_some());
        let mut settled: Vec<Term> = Vec::new();
        if named.len() < chosen.len()
            && let Some(beta) = fit(&self.together.evidence(&bases(chosen)), self.rules.prior)
        {
            let mut rest = beta.as_slice();
            for Candidate { basis, family, .. } in chosen.iter().map(|c| &c.candidate) {
                let (mine, others) = rest.split_at(basis.count());
                rest = others;
                if family.is_none() {
                    // A bias term even for the variance: both are subtracted in the same way.
                    settled.push(Term::bias(basis.clone(), mine.to_vec()));
                }
            }
        }
        let views = self.together.fine.par_iter().zip(self.together.coarse).zip(&self.groups);
        let is_fine = |c: &Candidate| c.basis.needs_tiles() && c.basis.alone().is_none();
        let keep_fine = self.candidates.iter().any(is_fine);
        views.filter_map(|((f, c), g)| prepare(f, c, g, keep_fine, &named, &settled)).collect()
    }

    /// Turns a candidate into a term that stays, with the gain it brings alone.
    fn pin(&self, candidate: Candidate) -> Chosen {
        let alone = gain(&self.together.evidence(&[&candidate.basis]), self.rules.prior);
        let gain = alone.map_or(0.0, |g| g.total);
        Chosen { gain, adequacy: self.rules.adequacy, ..Chosen::of(candidate) }
    }

    /// Sets up a trial of candidates given `chosen` and the pinned term.
    fn trial(&self, chosen: &[Chosen]) -> Option<Trial<'_>> {
        let beside: Vec<Chosen> = self.pinned.iter().chain(chosen).cloned().collect();
        let views = self.prepare(&beside);
        views.first()?;
        let settled = bases_where(&beside, |c| c.family.is_some()).iter().map(|b| b.count()).sum();
        let Layer { rules, largest, .. } = *self;
        let weight = self.together.coarse.iter().flat_map(|v| &v.weight).sum();
        let is_pinned = self.pinned.is_some();
        Some(Trial { beside, views, settled, is_pinned, weight, rules, largest })
    }

    /// Returns the best candidate given `chosen` and the pinned term, if its gain exceeds the noise
    /// threshold.
    fn step(&mut self, chosen: &[Chosen]) -> Option<Chosen> {
        let trial = self.trial(chosen)?;
        let simulates = self.noise.is_none() && self.rules.calibrated;
        let noise = simulates.then(|| trial.noise(self.candidates, &self.nests, self.seed));
        let of_nest = |(n, nest): (usize, &Vec<usize>)| {
            trial.judged(self.candidates, nest, noise.as_ref().map(|noise| &noise[n]))
        };
        let of_nests: Vec<Vec<(usize, Judged)>> =
            self.nests.par_iter().enumerate().map(of_nest).collect();
        let mut judged: Vec<Option<Judged>> = self.candidates.iter().map(|_| None).collect();
        of_nests.into_iter().flatten().for_each(|(k, j)| judged[k] = Some(j));
        let beside = trial.beside;
        if self.noise.is_none() {
            let noise = if simulates {
                let all = self.candidates.iter().zip(&judged);
                LayerNull::of(
                    all.filter_map(|(c, j)| Some((Group::of(c), &j.as_ref()?.of_noise[..]))),
                )
            } else {
                LayerNull::unknown()
            };
            self.looks = looks(self.candidates, &judged, self.rules, &noise);
            self.noise = Some(noise);
        }
        let noise = self.noise.as_ref()?;
        let candidates = self.candidates;
        let rules = self.rules.beside(chosen.len());
        let mut next =
            Choice { candidates, judged: &judged, rules: &rules, noise }.best(&beside)?;
        if let Some(bracket) = period::neighbours(candidates, &next.candidate) {
            let over = next.candidate.basis.alone();
            period::tune(bracket, &mut next, self.total_beside(chosen, over));
        }
        Some(next)
    }

    /// The pinned term, if any.
    fn pinned_bases(&self) -> Vec<&Basis> {
        self.pinned.iter().map(|c| &c.candidate.basis).collect()
    }

    /// Joint gain of `terms`, given the pinned term.
    fn total(&self, terms: &[&Basis]) -> f64 {
        self.given_pinned(&self.together.evidence(&[&self.pinned_bases()[..], terms].concat()))
    }

    /// Gain of evidence on the pinned term and others, given the pinned term.
    fn given_pinned(&self, evidence: &[Evidence]) -> f64 {
        let columns = self.pinned_bases().iter().map(|b| b.count()).sum();
        let beside = Beside::of(evidence, columns, self.rules.prior);
        let gain = beside.and_then(|b| gain(&b.alone(evidence), self.rules.prior));
        gain.map_or(0.0, |g| g.total)
    }

    /// [`Layer::total`] of `chosen` and one more basis, quick for many that depend on a coordinate alone.
    fn total_beside(&self, chosen: &[Chosen], over: Option<Coordinate>) -> impl Fn(&Basis) -> f64 {
        let beside = [self.pinned_bases(), bases(chosen)].concat();
        let views = self.together.fine.par_iter().zip(&self.groups);
        let merged: Vec<_> =
            views.filter_map(|(view, g)| merge_by(view, g, over?, &beside)).collect();
        move |basis| {
            if merged.is_empty() {
                return self.total(&[&bases(chosen)[..], &[basis]].concat());
            }
            let of_view = |(g, rows): &(&Grouping, Rows<'_>)| rows.evidence(basis, &g.places);
            self.given_pinned(&merged.iter().map(of_view).collect::<Vec<Evidence>>())
        }
    }
}

#[cfg(test)]
mod tests;
