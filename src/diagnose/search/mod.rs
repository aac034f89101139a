//! The search for missing terms: best first, each step judged on held-out views against what
//! noise alone would have brought.

pub mod bias;
pub mod candidate;
pub mod choose;
mod each_view;
pub mod evidence;
pub mod few_views;
pub mod judge;
pub mod layer_search;
pub mod noise_gains;
pub mod null;
pub mod outcome;
mod period;
pub mod posterior;
pub mod prepared;
pub mod rows;
pub mod rules;
mod trial;
pub mod variance;
pub mod view_levels;
pub mod view_worth;

use std::rc::Rc;

use rayon::prelude::*;

use crate::diagnose::views::samples::ViewData;
use crate::rng::Seed;
use crate::terms::{Basis, Term};
use candidate::Candidate;
use choose::Choice;
use evidence::{Evidence, fit, gain};
use judge::{Judged, looks};
use noise_gains::NoiseGains;
use null::{Null, beside_chosen};
use outcome::{Chosen, Look, Outcome, bases, bases_where};
use prepared::{Grouping, Patches, Prepared, Together, prepare};
use rules::Rules;
use trial::{Trial, nests};

/// A later term must bring this share of what the first brought: what is less is the first one's
/// own shape, badly met.
pub const MIN_SHARE_OF_GAIN: f64 = 0.005;

/// Search a layer. `coarse` has the same views in larger patches, for shapes that do not change
/// within them. A term `beside` is fitted with every other, whatever it brings: what it can take up is
/// attributed to no other term. It stays in, last of the chosen.
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

/// The terms that a fit holds together, the first chosen first and what is pinned last: between an error that is
/// certain to a millionth of a pixel and a prior of a pixel a fit runs out of digits, and a term that then
/// does not fit beside those before it is not told.
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
    /// Of every view's fine samples.
    groups: Vec<Vec<Grouping>>,
    candidates: &'a [Candidate],
    nests: Vec<Vec<usize>>,
    rules: &'a Rules,
    noise: Option<NoiseGains>,
    looks: Vec<Look>,
    /// Root mean square of the largest term so far.
    largest: f64,
    /// Fitted beside everything.
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

    /// Terms with a name are fitted anew beside every candidate; those without have many columns
    /// and are taken out as they were fitted.
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
                    // Of the mean or of the variance, it is taken out alike.
                    settled.push(Term::bias(basis.clone(), mine.to_vec()));
                }
            }
        }
        let views = self.together.fine.par_iter().zip(self.together.coarse).zip(&self.groups);
        let is_fine = |c: &Candidate| c.basis.needs_tiles() && c.basis.alone().is_none();
        let keep_fine = self.candidates.iter().any(is_fine);
        views.filter_map(|((f, c), g)| prepare(f, c, g, keep_fine, &named, &settled)).collect()
    }

    /// A term that stays, with what it brings alone.
    fn pin(&self, candidate: Candidate) -> Chosen {
        let alone = gain(&self.together.evidence(&[&candidate.basis]), self.rules.prior);
        let gain = alone.map_or(0.0, |g| g.total);
        let (adequacy, rivals) = (self.rules.adequacy, Vec::new());
        Chosen { candidate, rms: 0.0, adequacy, gain, best_curve: 0.0, rivals, p: 1.0 }
    }

    /// What `chosen` and what is pinned leave for a candidate to explain.
    fn trial(&self, chosen: &[Chosen]) -> Option<Trial<'_>> {
        let beside: Vec<Chosen> = self.pinned.iter().chain(chosen).cloned().collect();
        let views = self.prepare(&beside);
        let settled = views.first()?.beside(Patches::Coarse).b.len();
        let base = |patches| {
            let evidence: Vec<Evidence> = views.iter().map(|v| v.beside(patches)).collect();
            gain(&evidence, self.rules.prior)
        };
        let base = match self.pinned {
            None => Some([base(Patches::Fine)?, base(Patches::Coarse)?]),
            Some(_) => None,
        };
        let Layer { rules, largest, .. } = *self;
        let weight = self.together.coarse.iter().flat_map(|v| &v.weight).sum();
        Some(Trial { beside, views, settled, base, weight, rules, largest })
    }

    /// The best candidate beside `chosen` and what is pinned, if it brings more than noise can.
    fn step(&mut self, chosen: &[Chosen]) -> Option<Chosen> {
        let trial = self.trial(chosen)?;
        let of_nest = |nest: &Vec<usize>| trial.judged(self.candidates, nest);
        let of_nests: Vec<Vec<(usize, Judged)>> = self.nests.par_iter().map(of_nest).collect();
        let mut judged: Vec<Option<Judged>> = self.candidates.iter().map(|_| None).collect();
        of_nests.into_iter().flatten().for_each(|(k, j)| judged[k] = Some(j));
        let beside = trial.beside;
        if self.noise.is_none() {
            let nulls: Vec<&Null> = judged.iter().flatten().map(|j| &j.null).collect();
            let noise = if self.rules.calibrated {
                NoiseGains::of(&nulls, self.seed)
            } else {
                NoiseGains::unknown()
            };
            self.looks = looks(self.candidates, &judged, self.rules, &noise);
            self.noise = Some(noise);
        }
        let noise = self.noise.as_ref()?;
        let (candidates, rules) = (self.candidates, self.rules);
        let mut next = Choice { candidates, judged: &judged, rules, noise }.best(&beside)?;
        period::tune(candidates, chosen, &mut next, |terms| self.total(terms));
        Some(next)
    }

    /// What terms bring together, beside what is pinned.
    fn total(&self, terms: &[&Basis]) -> f64 {
        let pinned: Vec<&Basis> = self.pinned.iter().map(|c| &c.candidate.basis).collect();
        let columns = pinned.iter().map(|b| b.count()).sum();
        let evidence = self.together.evidence(&[&pinned[..], terms].concat());
        let alone = beside_chosen(&evidence, columns, self.rules.prior);
        alone.and_then(|alone| gain(&alone, self.rules.prior)).map_or(0.0, |g| g.total)
    }

    /// What was taken before what really is there brings no more than noise beside it.
    fn drop_needless(&self, chosen: &mut Vec<Chosen>) {
        let Some(noise) = &self.noise else { return };
        while chosen.len() > 1 {
            let whole = self.total(&bases(chosen));
            let lost = |k: usize| {
                let mut others = bases(chosen);
                others.remove(k);
                (k, whole - self.total(&others))
            };
            // A name whose own axis has a curve beside it is what that curve completes.
            let completed = |k: usize| {
                let axis = chosen[k].candidate.basis.axis();
                let nameless = |c: &Chosen| c.candidate.family.is_none();
                !nameless(&chosen[k])
                    && chosen.iter().any(|c| nameless(c) && c.candidate.basis.axis() == axis)
            };
            let concerned = (0..chosen.len()).filter(|&k| !completed(k));
            let idlest = concerned.map(lost).min_by(|a, b| a.1.total_cmp(&b.1));
            match idlest {
                Some((k, lost)) if lost < noise.threshold(self.rules.level) => chosen.remove(k),
                _ => return,
            };
        }
    }

    /// Maps with twice as many nodes, where those predict left-out views better.
    fn refine_maps(&self, chosen: &mut [Chosen]) {
        let mut so_far = None;
        for k in 0..chosen.len() {
            let Basis::Map { width, height, across, down, times } = chosen[k].candidate.basis
            else {
                continue;
            };
            let finer = Basis::Map { width, height, across: 2 * across, down: 2 * down, times };
            let old = bases(chosen);
            let mut new = old.clone();
            new[k] = &finer;
            let before = *so_far.get_or_insert_with(|| self.total(&old));
            let after = self.total(&new);
            let better = after - before;
            if self.noise.as_ref().is_some_and(|n| better > n.threshold(self.rules.level)) {
                chosen[k].gain += better;
                chosen[k].candidate.basis = finer;
                so_far = Some(after);
            }
        }
    }

    /// With all names in, is each still what fits best, and needed at all? The last was chosen beside the
    /// others: it is, unless these have changed.
    fn look_back(&mut self, chosen: &mut Vec<Chosen>) {
        let (mut k, mut changed) = (0, false);
        while chosen.len() > 1 && k < chosen.len() {
            if k + 1 == chosen.len() && !changed {
                break;
            }
            let mut others = chosen.clone();
            let old = others.remove(k);
            match self.step(&others) {
                None => {
                    chosen.remove(k);
                    changed = true;
                    continue;
                }
                Some(new) if new.candidate.family == old.candidate.family => {
                    changed |= new.candidate.basis != old.candidate.basis;
                    chosen[k] = Chosen { p: old.p.min(new.p), ..new };
                }
                // Another name is taken; a curve without one is not.
                Some(new) if new.candidate.family.is_some() => {
                    changed = true;
                    chosen[k] = new;
                }
                Some(_) => {}
            }
            k += 1;
        }
        chosen.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    }
}

#[cfg(test)]
mod tests;
