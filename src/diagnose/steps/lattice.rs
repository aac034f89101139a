//! Lattices of the depths that occur: the steps of the matcher, and those of the driver.

use super::coarse::{Place, coarsest_step};
use super::comb::{
    CHANCE, COARSE, Gathered, PHASE_STEP, STEPS_PX, STEPS_UNITS, steps_of_depths,
    steps_of_disparities, steps_of_words,
};
use crate::frame::DepthCode;
use crate::stats::gcd;
use crate::view::Sensor;

/// Number of times each raw word occurs on the targets.
#[derive(Debug, Clone)]
pub struct RawHistogram(pub Vec<u32>);

impl Default for RawHistogram {
    fn default() -> Self {
        RawHistogram(vec![0; 1 << 16])
    }
}

/// A step that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Of the depth, m, or else of the disparity, px.
    pub is_of_depth: bool,
    pub size: f64,
    /// P-value if all words were equally likely to occur; `None` where the format itself has the steps.
    pub p: Option<f64>,
}

/// Fewest distinct words for phases to show a lattice.
const MIN_WORDS: usize = 12;
/// Fewest distinct words for any lattice: two determine it, and at least three must rule out chance.
const MIN_FEW: usize = 5;
/// Least contrast between neighbouring words, crowded or empty, that suggests a lattice.
const CONTRAST: f64 = 0.4;
/// Resultant length below which phases fit no lattice; a dozen random words reach it.
const GATHERED_AT_ALL: f64 = 0.4;
/// Largest relative change of a step by a scale of the depth or by its own error.
const STEP_ERROR: f64 = 0.02;
/// Coarsest step of the disparity that is tried, px. Matchers answer in whole pixels at the coarsest, of
/// pictures that may be an eighth as wide as the stored one.
const COARSEST_PX: f64 = 8.0;
/// A step of which a comb is a fraction is at least twice as coarse.
const COARSER: f64 = 1.5;

impl Step {
    /// Its size at this depth, px.
    pub fn px(&self, scale_px_m: f64, z: f64) -> f64 {
        if self.is_of_depth { self.size * scale_px_m / (z * z) } else { self.size }
    }
}

impl RawHistogram {
    pub fn merge(&mut self, other: &RawHistogram) {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a = a.saturating_add(*b));
    }

    fn occurring(&self) -> Vec<(usize, f64)> {
        self.0
            .iter()
            .enumerate()
            .filter(|(_, n)| **n > 0)
            .map(|(w, n)| (w, f64::from(*n)))
            .collect()
    }

    /// Counts the words of a picture.
    pub fn count(&mut self, words: impl Iterator<Item = u16>) {
        for w in words {
            let count = &mut self.0[usize::from(w)];
            *count = count.saturating_add(1);
        }
    }

    /// Whether there are too few distinct words for their counts to show a lattice.
    pub fn is_few(&self) -> bool {
        self.0.iter().filter(|n| **n > 0).take(MIN_WORDS).count() < MIN_WORDS
    }

    /// Step of the lattice that the words lie on.
    pub fn lattice(&self, sensor: &Sensor, scale_px_m: f64) -> Option<Step> {
        match sensor.code {
            DepthCode::Metric { units_per_metre, .. } => {
                self.of_depths(units_per_metre, scale_px_m)
            }
            // The words are a lattice; a coarser one leaves some of them empty.
            DepthCode::Disparity { slope, .. } => self.of_raw_words(slope.abs() * scale_px_m),
        }
    }

    fn of_depths(&self, units_per_metre: f64, scale_px_m: f64) -> Option<Step> {
        let words = self.occurring();
        let of_depth = |(units, p)| {
            let size = units / units_per_metre;
            Some(Step { is_of_depth: true, size, p: Some(p) })
        };
        let of_disparity = |(size, p)| Some(Step { is_of_depth: false, size, p: Some(p) });
        let stride = words.iter().fold(0, |g, (w, _)| gcd(g, *w));
        let by_chance = all_multiples(stride, words.len());
        let few = words.len() < MIN_WORDS;
        // A handful of round distances is not a step.
        let by_few =
            words.len() >= MIN_FEW && by_chance < CHANCE && stride <= STEPS_UNITS[1] as usize;
        if stride > 1 && (!few || by_few) {
            return of_depth((stride as f64, by_chance));
        }
        if words.is_empty() || self.contrast(&words) < CONTRAST {
            return None;
        }
        let px_words = scale_px_m * units_per_metre;
        let (disparity, depth) = if few {
            Default::default()
        } else {
            (steps_of_disparities(&words, px_words), steps_of_depths(&words))
        };
        let places = |of: &dyn Fn(f64) -> [f64; 2]| -> Vec<Place> {
            let place = |&(word, n): &(usize, f64)| {
                let [at, width] = of(word as f64);
                Place { at, width, weight: n.sqrt() }
            };
            words.iter().map(place).collect()
        };
        // A comb shows a step, or a fraction of it.
        let finest_px = disparity.step().map_or(STEPS_PX[0], |step| COARSER * step);
        let in_px = places(&|w| [px_words / w, px_words / (w * w)]);
        let coarse_px = coarsest_step(&in_px, [COARSEST_PX, finest_px]);
        let [finest, coarsest] = STEPS_UNITS;
        let coarse_units = || coarsest_step(&places(&|w| [w, 1.0]), [coarsest, finest]);
        match (coarse_px, few.then(coarse_units).flatten()) {
            (Some(px), Some(units)) if units.1 < px.1 => of_depth(units),
            (Some(px), _) => of_disparity(px),
            (None, Some(units)) => of_depth(units),
            (None, None) => {
                if depth.resultant > disparity.resultant {
                    of_depth((depth.step()?, depth.p))
                } else {
                    of_disparity((disparity.step()?, disparity.p))
                }
            }
        }
    }

    fn of_raw_words(&self, word_px: f64) -> Option<Step> {
        let words = self.occurring();
        let first = words.first()?;
        let few = words.len() < MIN_WORDS;
        let stride = words.iter().fold(0, |g, (w, _)| gcd(g, w - first.0));
        let coarser = if stride > 1 {
            Some((stride as f64, all_multiples(stride, words.len() - 1)))
        } else {
            (!few).then(|| steps_of_words(&words)).flatten()
        };
        let coarser = coarser.filter(|c| !few || c.1 < CHANCE);
        if few && coarser.is_none() {
            return None;
        }
        let size = coarser.map_or(1.0, |c| c.0) * word_px;
        Some(Step { is_of_depth: false, size, p: coarser.map(|c| c.1) })
    }

    /// Whether the words lie on a lattice of this step, allowing for a scale or the step's own error. `None`
    /// where too few words could show it.
    pub fn on(&self, step: Step, sensor: &Sensor, scale_px_m: f64) -> Option<bool> {
        let at = |w: usize| {
            let z = sensor.code.metres(u16::try_from(w).ok()?)?;
            Some(if step.is_of_depth { z } else { scale_px_m / z })
        };
        let size = step.size;
        let fine = |&(w, n): &(usize, f64)| {
            let place = at(w)?;
            let width = (at(w + 1)? - place).abs();
            (width < COARSE * size).then_some((place, n.sqrt()))
        };
        let words: Vec<(f64, f64)> = self.occurring().iter().filter_map(fine).collect();
        let range = crate::stats::range(words.iter().map(|w| w.0));
        if words.len() < MIN_WORDS || range[1] - range[0] < size {
            return None;
        }
        let cycles = (range[1] - range[0]) / size;
        let tries = (2.0 * STEP_ERROR * cycles / PHASE_STEP).ceil().clamp(1.0, 1e4);
        let tried = |k: f64| size * (1.0 - STEP_ERROR + 2.0 * STEP_ERROR * k / tries);
        let tries =
            (0..=tries as usize).map(|k| Gathered::of(&words, 1.0 / tried(k as f64)).resultant);
        Some(tries.fold(0.0, f64::max) > GATHERED_AT_ALL)
    }

    /// Contrast between the counts of neighbouring words, 0 (smooth) to 1 (every other one empty).
    fn contrast(&self, words: &[(usize, f64)]) -> f64 {
        let (mut differ, mut sum) = (0.0, 0.0);
        for &(w, n) in words {
            let next = f64::from(*self.0.get(w + 1).unwrap_or(&0));
            differ += (n - next).abs();
            sum += n + next;
        }
        differ / f64::max(sum, 1.0)
    }
}

/// Probability that so many words are all multiples of `step`, or of any coarser step.
fn all_multiples(step: usize, words: usize) -> f64 {
    let (step, n) = (step as f64, words as f64);
    (step.powf(-n) * (1.0 + step / (n - 1.0).max(1.0))).clamp(f64::MIN_POSITIVE, 1.0)
}

#[cfg(test)]
#[path = "lattice_tests.rs"]
mod tests;
