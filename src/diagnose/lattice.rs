//! Which depths occur at all: the steps of the matcher, and those of the driver.

use std::f64::consts::TAU;

use crate::frame::DepthCode;
use crate::view::Sensor;

/// How often each stored word occurs on the targets.
#[derive(Debug, Clone)]
pub struct RawHistogram(pub Vec<u32>);

/// Steps that were found.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quantisation {
    /// All words are multiples of this many units: depth in metres a step.
    pub depth_step_m: Option<f64>,
    /// Occurring disparities are multiples of this, px, give or take a constant.
    pub disparity_step_px: Option<f64>,
    /// Chance of such steps were all words as likely to occur; `None` where the format has the steps.
    pub depth_p: Option<f64>,
    pub disparity_p: Option<f64>,
}

/// Fewer distinct words than this make no lattice.
const FEWEST_WORDS: usize = 12;
/// Phases gathered more than this belong to a lattice: chance over the scanned frequencies and a
/// hundred words reaches 0.4.
const GATHERED: f64 = 0.6;
/// Neighbouring words that alternate between crowded and empty by this share.
const CONTRAST: f64 = 0.4;
/// Words wider than this share of a step cannot show it.
const COARSE: f64 = 0.35;
/// Phases gathered less than this belong to none: a dozen words by chance gather so much.
const GATHERED_AT_ALL: f64 = 0.4;
/// What a scale of the depth, or the error of a step, may change it by, as a share.
const STEP_ERROR: f64 = 0.02;
/// Coarsest and finest steps looked for, px.
const STEPS_PX: [f64; 2] = [1.0 / 3.0, 1.0 / 64.0];

impl Quantisation {
    pub fn is_some(&self) -> bool {
        self.depth_step_m.is_some() || self.disparity_step_px.is_some()
    }

    /// The coarser step at this depth, px.
    pub fn step_px(&self, scale_px_m: f64, z: f64) -> f64 {
        let depth = self.depth_step_m.map_or(0.0, |step| step * scale_px_m / (z * z));
        self.disparity_step_px.unwrap_or(0.0).max(depth)
    }
}

impl RawHistogram {
    pub fn none() -> Self {
        RawHistogram(vec![0; 1 << 16])
    }

    pub fn merge(&mut self, other: &RawHistogram) {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a += b);
    }

    fn occurring(&self) -> Vec<(usize, f64)> {
        self.0
            .iter()
            .enumerate()
            .filter(|(_, n)| **n > 0)
            .map(|(w, n)| (w, f64::from(*n)))
            .collect()
    }

    /// The lattice the words lie on.
    pub fn lattice(&self, sensor: &Sensor, scale_px_m: f64) -> Quantisation {
        let words = self.occurring();
        if words.len() < FEWEST_WORDS {
            return Quantisation::default();
        }
        let stride = words.iter().fold(0, |g, (w, _)| gcd(g, *w));
        match sensor.code {
            DepthCode::Metric { units_per_metre, .. } => {
                let (step, p) = self.scan(&words, scale_px_m * units_per_metre);
                Quantisation {
                    depth_step_m: (stride > 1).then(|| stride as f64 / units_per_metre),
                    disparity_step_px: step.filter(|_| stride == 1),
                    depth_p: (stride > 1).then(|| all_multiples(stride, words.len())),
                    disparity_p: step.filter(|_| stride == 1).and(Some(p)),
                }
            }
            DepthCode::Disparity { slope, .. } => {
                // Words are the lattice; what is left to see is whether only every n-th occurs.
                let offsets = words.iter().fold(0, |g, (w, _)| gcd(g, w - words[0].0));
                Quantisation {
                    depth_step_m: None,
                    disparity_step_px: Some(offsets.max(1) as f64 * slope.abs() * scale_px_m),
                    depth_p: None,
                    disparity_p: (offsets > 1).then(|| all_multiples(offsets, words.len() - 1)),
                }
            }
        }
    }

    /// The step of the frequency at which the disparities' phases gather most, and the chance of it.
    fn scan(&self, words: &[(usize, f64)], px_words: f64) -> (Option<f64>, f64) {
        if self.contrast(words) < CONTRAST {
            return (None, 1.0);
        }
        let disparities: Vec<(f64, f64, f64)> = words
            .iter()
            // A count counts less and less: a lattice shows in which words occur.
            .map(|&(w, n)| (px_words / w as f64, n.sqrt(), px_words / (w * w) as f64))
            .collect();
        let range = disparities[0].0 - disparities[disparities.len() - 1].0;
        let mut best = (0.0, 0.0, 0.0);
        let mut scanned = 0.0;
        let mut frequency = 1.0 / STEPS_PX[0];
        while frequency < 1.0 / STEPS_PX[1] {
            let (mut c, mut s, mut n, mut squares) = (0.0, 0.0, 0.0, 0.0);
            for &(d, weight, width) in &disparities {
                // Words coarser than the lattice cannot show it.
                if width * frequency < COARSE {
                    let (sin, cos) = (TAU * frequency * d).sin_cos();
                    c += weight * cos;
                    s += weight * sin;
                    n += weight;
                    squares += weight * weight;
                }
            }
            let resultant = f64::hypot(c, s) / f64::max(n, 1e-9);
            if n > 0.0 && resultant > best.1 {
                best = (frequency, resultant, n * n / squares);
            }
            scanned += 1.0;
            frequency += 0.15 / range.max(1.0);
        }
        // Rayleigh's test, at each of the scanned frequencies.
        let (frequency, resultant, words) = best;
        let p = (scanned * (-words * resultant * resultant).exp()).clamp(f64::MIN_POSITIVE, 1.0);
        ((resultant > GATHERED).then(|| 1.0 / frequency), p)
    }

    /// Do the disparities lie on a lattice of this step, give or take what a scale or its own error
    /// makes of it? `None` where too few words could show it.
    pub fn on_disparities(&self, step: f64, sensor: &Sensor, scale_px_m: f64) -> Option<bool> {
        let disparity = |w: usize| Some(scale_px_m / sensor.code.metres(u16::try_from(w).ok()?)?);
        let fine = |&(w, n): &(usize, f64)| {
            let d = disparity(w)?;
            let width = (disparity(w + 1)? - d).abs();
            (width < COARSE * step).then_some((d, n.sqrt()))
        };
        let words: Vec<(f64, f64)> = self.occurring().iter().filter_map(fine).collect();
        let range = crate::stats::range(words.iter().map(|w| w.0));
        if words.len() < FEWEST_WORDS || range[1] - range[0] < step {
            return None;
        }
        let total: f64 = words.iter().map(|w| w.1).sum();
        let gathered = |step: f64| {
            let sum = |part: fn(f64) -> f64| -> f64 {
                words.iter().map(|(d, weight)| weight * part(TAU * d / step)).sum()
            };
            sum(f64::cos).hypot(sum(f64::sin)) / total
        };
        let cycles = (range[1] - range[0]) / step;
        let tries = (2.0 * STEP_ERROR * cycles / 0.15).ceil().clamp(1.0, 1e4);
        let tried = |k: f64| step * (1.0 - STEP_ERROR + 2.0 * STEP_ERROR * k / tries);
        let tries = (0..=tries as usize).map(|k| gathered(tried(k as f64)));
        Some(tries.fold(0.0, f64::max) > GATHERED_AT_ALL)
    }

    /// Are most depths multiples of this step? `None` where the words are no finer.
    pub fn on_depths(&self, step_m: f64, sensor: &Sensor) -> Option<bool> {
        let words = self.occurring();
        let depth = |w: usize| sensor.code.metres(u16::try_from(w).ok()?);
        let (mut multiples, mut all) = (0.0, 0.0);
        for &(w, n) in &words {
            let (Some(z), Some(next)) = (depth(w), depth(w + 1)) else { continue };
            let unit = (next - z).abs();
            if unit < COARSE * step_m {
                let off = (z / step_m - (z / step_m).round()).abs() * step_m;
                multiples += if off <= 0.5 * unit * 1.001 { n } else { 0.0 };
                all += n;
            }
        }
        (words.len() >= FEWEST_WORDS && all > 0.0).then_some(multiples > 0.5 * all)
    }

    /// How much neighbouring words differ in number, 0 (smooth) to 1 (every other one empty).
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

/// Chance that so many words are all multiples of `step`, or of any coarser one.
fn all_multiples(step: usize, words: usize) -> f64 {
    let (step, n) = (step as f64, words as f64);
    (step.powf(-n) * (1.0 + step / (n - 1.0).max(1.0))).clamp(f64::MIN_POSITIVE, 1.0)
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use crate::simulate::kinect_v1;
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn words(step_px: f64, rounding: f64) -> RawHistogram {
        let mut rng = Seed(1).stream("lattice");
        let mut words = RawHistogram::none();
        let sensor = kinect_v1(1);
        for _ in 0..200_000 {
            let z: f64 = rng.random_range(0.8..3.0);
            let noise: f64 = StandardNormal.sample(&mut rng);
            let mut d = 43.5 / z + 0.08 * noise;
            if step_px > 0.0 {
                d = (d / step_px).round() * step_px;
            }
            let z = 43.5 / d;
            let z = if rounding > 0.0 { (z / rounding).round() * rounding } else { z };
            words.0[usize::from(sensor.code.raw(z))] += 1;
        }
        words
    }

    #[test]
    fn steps_of_matcher_and_driver_are_found_and_none_where_there_are_none() {
        let sensor = kinect_v1(1);
        let found = words(0.125, 0.0).lattice(&sensor, 43.5);
        assert!((found.disparity_step_px.unwrap() / 0.125 - 1.0).abs() < 2e-3, "{found:?}");
        let found = words(0.0, 0.001).lattice(&sensor, 43.5);
        assert_eq!((found.depth_step_m, found.disparity_step_px), (Some(0.001), None));
        let found = words(0.0, 0.0).lattice(&sensor, 43.5);
        assert_eq!((found.depth_step_m, found.disparity_step_px), (None, None), "{found:?}");
    }
}
