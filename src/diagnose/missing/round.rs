//! One round of the dropout search: judges all shapes and selects the detected one.

use super::cells::{Cell, Scatter};
use super::report::NAME_ADEQUATE;
use super::search::{Judged, Losses};
use super::shapes::Step;
use super::{LEVEL, TESTS};
use crate::diagnose::search::noise_gains::NoiseGains;
use crate::rng::Seed;
use crate::terms::Basis;

/// Shapes judged with the scatter that the best of them leaves, and the gains of noise alone.
pub struct Round<'a> {
    pub ledger: Losses<'a>,
    /// Best first.
    pub judged: Vec<Judged>,
    pub noise: NoiseGains,
}

impl<'a> Round<'a> {
    pub fn of(
        views: &'a [Vec<Cell<'a>>],
        explained: &[Vec<f64>],
        (steps, curves): (&[Step], &[Basis]),
        min_scatter: Scatter,
        seed: Seed,
    ) -> Option<Self> {
        let ledger = Losses::new(views, explained)?;
        let (first, _) = ledger.judge(steps, curves, None);
        let all: Vec<usize> = (0..first.len()).collect();
        let ledger = ledger.scattered_as_left_by(&first[choose(&first, &all)?], min_scatter)?;
        let (judged, noise) = ledger.judge(steps, curves, Some(seed));
        Some(Round { ledger, judged, noise })
    }

    pub fn threshold(&self) -> f64 {
        self.noise.threshold(LEVEL / TESTS)
    }

    /// Index of the detected shape, and its gain in nats.
    pub fn won(&self) -> Option<(usize, f64)> {
        choose(&self.judged, &self.seen()).map(|k| (k, self.judged[k].gain))
    }

    /// Same for the best shape still detected when any single view is left out.
    pub fn won_beyond_one_view(&self) -> Option<(usize, f64)> {
        let mut open = self.seen();
        while let Some(k) = choose(&self.judged, &open) {
            let counts = self.ledger.beyond_one_view(&self.judged[k]);
            if counts > self.threshold() {
                return Some((k, counts));
            }
            open.retain(|other| *other != k);
        }
        None
    }

    fn seen(&self) -> Vec<usize> {
        let threshold = self.threshold();
        (0..self.judged.len()).take_while(|&k| self.judged[k].gain > threshold).collect()
    }
}

/// Index of the best step of `among` (best first), or of the best curve where that leaves the step behind.
fn choose(judged: &[Judged], among: &[usize]) -> Option<usize> {
    let best =
        |named: bool| among.iter().copied().find(|&k| judged[k].shape.family().is_some() == named);
    let (step, curve) = (best(true), best(false));
    let enough = curve.map_or(0.0, |c| NAME_ADEQUATE * judged[c].gain);
    step.filter(|&s| judged[s].gain > enough).or(curve)
}
