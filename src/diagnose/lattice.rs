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
/// Finest and coarsest steps of the depth looked for, in units of the words: two are gathered by
/// sin(pi / 2) / (pi / 2), just above [`GATHERED`].
const STEPS_UNITS: [f64; 2] = [2.0, 500.0];
/// The range of words in which they are looked for first.
const DENSE_UNITS: f64 = 1024.0;
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
                if stride > 1 {
                    return Quantisation {
                        depth_step_m: Some(stride as f64 / units_per_metre),
                        depth_p: Some(all_multiples(stride, words.len())),
                        ..Quantisation::default()
                    };
                }
                if self.contrast(&words) < CONTRAST {
                    return Quantisation::default();
                }
                let disparity = scan(&words, scale_px_m * units_per_metre);
                let depth = scan_depths(&words);
                if depth.resultant > disparity.resultant {
                    return Quantisation {
                        depth_step_m: depth.step().map(|units| units / units_per_metre),
                        depth_p: depth.step().and(Some(depth.p)),
                        ..Quantisation::default()
                    };
                }
                Quantisation {
                    disparity_step_px: disparity.step(),
                    disparity_p: disparity.step().and(Some(disparity.p)),
                    ..Quantisation::default()
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

/// The frequency at which phases gather most, how much they do (0 to 1), and the chance of it.
#[derive(Default)]
struct Comb {
    frequency: f64,
    resultant: f64,
    p: f64,
}

impl Comb {
    fn step(&self) -> Option<f64> {
        (self.resultant > GATHERED).then(|| 1.0 / self.frequency)
    }

    /// Of the places, with their weights, that `at` gives for each frequency of an even scan.
    fn scan<'a>(from: f64, to: f64, by: f64, at: &dyn Fn(f64) -> &'a [(f64, f64)]) -> Self {
        let mut best = Comb::default();
        let (mut worth, mut scanned) = (0.0, 0.0);
        let mut frequency = from;
        while frequency < to {
            let (mut c, mut s, mut n, mut squares) = (0.0, 0.0, 0.0, 0.0);
            for &(x, weight) in at(frequency) {
                let (sin, cos) = (TAU * frequency * x).sin_cos();
                c += weight * cos;
                s += weight * sin;
                n += weight;
                squares += weight * weight;
            }
            let resultant = f64::hypot(c, s) / f64::max(n, 1e-9);
            if n > 0.0 && resultant > best.resultant {
                (best.frequency, best.resultant) = (frequency, resultant);
                worth = n * n / squares;
            }
            scanned += 1.0;
            frequency += by;
        }
        // Rayleigh's test, at each of the scanned frequencies.
        let chance: f64 = scanned * (-worth * best.resultant * best.resultant).exp();
        Comb { p: chance.clamp(f64::MIN_POSITIVE, 1.0), ..best }
    }
}

/// A scan goes on by this share of a cycle over the range of what it looks at.
const PHASE_STEP: f64 = 0.15;

/// Steps of the disparity, px: words are `px_words` over their disparity.
fn scan(words: &[(usize, f64)], px_words: f64) -> Comb {
    let disparities: Vec<(f64, f64)> = words
        .iter()
        // A count counts less and less: a lattice shows in which words occur.
        .map(|&(w, n)| (px_words / w as f64, n.sqrt()))
        .collect();
    let range = disparities[0].0 - disparities[disparities.len() - 1].0;
    // Words coarser than the lattice, the nearest ones, cannot show it.
    let fine = |frequency: f64| {
        let coarse = |&(w, _): &(usize, f64)| px_words / (w * w) as f64 * frequency >= COARSE;
        &disparities[words.partition_point(coarse)..]
    };
    Comb::scan(1.0 / STEPS_PX[0], 1.0 / STEPS_PX[1], PHASE_STEP / range.max(1.0), &fine)
}

/// Steps of the depth that are no whole number of units: where words lie densest first, then finer and
/// finer over more of them.
fn scan_depths(words: &[(usize, f64)]) -> Comb {
    let places: Vec<(f64, f64)> = words.iter().map(|&(w, n)| (w as f64, n.sqrt())).collect();
    let within = |middle: f64, range: f64| {
        let from = places.partition_point(|p| p.0 < middle - 0.5 * range);
        &places[from..places.partition_point(|p| p.0 < middle + 0.5 * range)]
    };
    let all = places[places.len() - 1].0 - places[0].0;
    let mut range = DENSE_UNITS.min(all);
    let crowded = |w: &(f64, f64)| within(w.0, range).iter().map(|p| p.1).sum::<f64>();
    let every = (places.len() / 64).max(1);
    let densest = places.iter().step_by(every).max_by(|a, b| crowded(a).total_cmp(&crowded(b)));
    let middle = densest.map_or(0.0, |p| p.0);
    let near = within(middle, range);
    let mut comb =
        Comb::scan(1.0 / STEPS_UNITS[1], 1.0 / STEPS_UNITS[0], PHASE_STEP / range, &|_| near);
    let mut p = comb.p;
    while range < 2.0 * all {
        let off = 2.0 * PHASE_STEP / range;
        range *= 2.0;
        let more = within(middle, range);
        let (from, to) = (comb.frequency - off, comb.frequency + off);
        comb = Comb::scan(from, to, PHASE_STEP / range, &|_| more);
        p = p.min(comb.p * STEPS_UNITS[1] * range / PHASE_STEP);
    }
    Comb { p: p.clamp(f64::MIN_POSITIVE, 1.0), ..comb }
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
        for rounding in [0.00045, 0.000907, 0.00121, 0.0123] {
            let found = words(0.0, rounding).lattice(&sensor, 43.5);
            let step = found.depth_step_m.expect("a step that is no whole number of units");
            assert!((step / rounding - 1.0).abs() < 1e-4, "{rounding}: {found:?}");
            assert!(found.disparity_step_px.is_none() && found.depth_p.is_some_and(|p| p < 1e-9));
        }
        let found = words(0.0, 0.0).lattice(&sensor, 43.5);
        assert_eq!((found.depth_step_m, found.disparity_step_px), (None, None), "{found:?}");
    }
}
