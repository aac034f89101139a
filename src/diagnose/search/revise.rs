//! Revises the chosen terms given each other: drops, replaces and refines them.

use super::Layer;
use super::candidate::Candidate;
use super::layer_null::{Group, LayerNull};
use super::outcome::{Chosen, bases};
use crate::terms::Basis;

impl Layer<'_> {
    fn threshold(&self, noise: &LayerNull, candidate: &Candidate) -> f64 {
        noise.threshold(Group::of(candidate), self.rules.later().level)
    }

    /// Drops terms that bring no more than noise given the others, such as one chosen before the real
    /// cause.
    pub(super) fn drop_needless(&self, chosen: &mut Vec<Chosen>) {
        let Some(noise) = &self.noise else { return };
        while chosen.len() > 1 {
            let whole = self.total(&bases(chosen));
            let lost = |k: usize| {
                let mut others = bases(chosen);
                others.remove(k);
                (k, whole - self.total(&others))
            };
            // A name stays if a nameless curve on its own axis completes it.
            let completed = |k: usize| {
                let axis = chosen[k].candidate.basis.axis();
                let nameless = |c: &Chosen| c.candidate.family.is_none();
                !nameless(&chosen[k])
                    && chosen.iter().any(|c| nameless(c) && c.candidate.basis.axis() == axis)
            };
            let concerned = (0..chosen.len()).filter(|&k| !completed(k)).map(lost);
            let beyond =
                |(k, lost): (usize, f64)| (k, lost - self.threshold(noise, &chosen[k].candidate));
            let needless = concerned.map(beyond).filter(|(_, beyond)| *beyond < 0.0);
            match needless.min_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((k, _)) => chosen.remove(k),
                None => return,
            };
        }
    }

    /// Doubles the nodes of maps along each axis, where that predicts left-out views better.
    pub(super) fn refine_maps(&self, chosen: &mut [Chosen]) {
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
            let is_clear = |noise| better > self.threshold(noise, &chosen[k].candidate);
            if self.noise.as_ref().is_some_and(is_clear) {
                chosen[k].gain += better;
                chosen[k].candidate.basis = finer;
                so_far = Some(after);
            }
        }
    }

    /// Re-checks every named term given the others: replaces it where another fits best, drops it where
    /// none is needed. The last was chosen given the others, so it is checked only if these have
    /// changed.
    pub(super) fn look_back(&mut self, chosen: &mut Vec<Chosen>) {
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
                // Another name replaces it; a nameless curve does not.
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
