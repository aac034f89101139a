//! Which depths occur at all: the steps of the matcher, and those of the driver.

use super::comb::{
    COARSE, Gathered, PHASE_STEP, steps_of_depths, steps_of_disparities, steps_of_words,
};
use crate::frame::DepthCode;
use crate::view::Sensor;

/// How often each stored word occurs on the targets.
#[derive(Debug, Clone)]
pub struct RawHistogram(pub Vec<u32>);

/// A step that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    pub size: f64,
    /// Chance of it were all words as likely to occur; `None` where the format has the steps.
    pub p: Option<f64>,
}

/// Steps that were found.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quantisation {
    /// All words are multiples of so many units: depth in metres a step.
    pub depth: Option<Step>,
    /// Occurring disparities are multiples of this, px, give or take a constant.
    pub disparity: Option<Step>,
}

/// Fewer distinct words than this make no lattice.
const MIN_WORDS: usize = 12;
/// Neighbouring words that alternate between crowded and empty by this share.
const CONTRAST: f64 = 0.4;
/// Phases gathered less than this belong to none: a dozen words by chance gather so much.
const GATHERED_AT_ALL: f64 = 0.4;
/// What a scale of the depth, or the error of a step, may change it by, as a share.
const STEP_ERROR: f64 = 0.02;

impl Quantisation {
    pub fn is_some(&self) -> bool {
        self.depth.is_some() || self.disparity.is_some()
    }

    /// The coarser step at this depth, px.
    pub fn step_px(&self, scale_px_m: f64, z: f64) -> f64 {
        let depth = self.depth.map_or(0.0, |step| step.size * scale_px_m / (z * z));
        self.disparity.map_or(0.0, |step| step.size).max(depth)
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
        if words.len() < MIN_WORDS {
            return Quantisation::default();
        }
        let stride = words.iter().fold(0, |g, (w, _)| gcd(g, *w));
        match sensor.code {
            DepthCode::Metric { units_per_metre, .. } => {
                let of_depth = |size, p| Step { size: size / units_per_metre, p };
                if stride > 1 {
                    let p = all_multiples(stride, words.len());
                    let depth = Some(of_depth(stride as f64, Some(p)));
                    return Quantisation { depth, disparity: None };
                }
                if self.contrast(&words) < CONTRAST {
                    return Quantisation::default();
                }
                let disparity = steps_of_disparities(&words, scale_px_m * units_per_metre);
                let depth = steps_of_depths(&words);
                if depth.resultant > disparity.resultant {
                    let depth = depth.step().map(|size| of_depth(size, Some(depth.p)));
                    return Quantisation { depth, disparity: None };
                }
                let p = Some(disparity.p);
                let disparity = disparity.step().map(|size| Step { size, p });
                Quantisation { depth: None, disparity }
            }
            DepthCode::Disparity { slope, .. } => {
                // Words are the lattice; what is left to see is whether a coarser one leaves some empty.
                let word_px = slope.abs() * scale_px_m;
                let stride = words.iter().fold(0, |g, (w, _)| gcd(g, w - words[0].0));
                let coarser = if stride > 1 {
                    Some((stride as f64, all_multiples(stride, words.len() - 1)))
                } else {
                    steps_of_words(&words)
                };
                let size = coarser.map_or(1.0, |c| c.0) * word_px;
                let disparity = Some(Step { size, p: coarser.map(|c| c.1) });
                Quantisation { depth: None, disparity }
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
        if words.len() < MIN_WORDS || range[1] - range[0] < step {
            return None;
        }
        let cycles = (range[1] - range[0]) / step;
        let tries = (2.0 * STEP_ERROR * cycles / PHASE_STEP).ceil().clamp(1.0, 1e4);
        let tried = |k: f64| step * (1.0 - STEP_ERROR + 2.0 * STEP_ERROR * k / tries);
        let tries =
            (0..=tries as usize).map(|k| Gathered::of(&words, 1.0 / tried(k as f64)).resultant);
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
        (words.len() >= MIN_WORDS && all > 0.0).then_some(multiples > 0.5 * all)
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

    /// A matcher's steps of 1.28 to 13.4 words, each in the word nearest to it, and its own words.
    #[test]
    fn raw_words_show_steps_that_are_no_whole_number_of_them() {
        let word_px = 0.125;
        let (offset, slope) = (1100.0 * word_px / 43.5, -word_px / 43.5);
        let code = DepthCode::Disparity { offset, slope, invalid: 2047 };
        let sensor = Sensor { code, ..kinect_v1(1) };
        let mut rng = Seed(4).stream("lattice/raw");
        let mut found = |step_px: f64| {
            let mut words = RawHistogram::none();
            for _ in 0..100_000 {
                let noise: f64 = StandardNormal.sample(&mut rng);
                let mut d = rng.random_range(14.0..44.0) + 0.08 * noise;
                if step_px > 0.0 {
                    d = (d / step_px).round() * step_px;
                }
                words.0[((d / 43.5 - offset) / slope).round() as usize] += 1;
            }
            words.lattice(&sensor, 43.5)
        };
        for step_px in [0.16, 0.2, 0.25, 1.0 / 3.0, 0.5, 0.9125, 1.2125, 1.675] {
            let found = found(step_px);
            let step = found.disparity.expect("a step");
            assert!((step.size / step_px - 1.0).abs() < 5e-3, "{step_px}: {found:?}");
            assert!(step.p.is_some_and(|p| p < 1e-4), "{found:?}");
        }
        let own = found(0.0).disparity.unwrap();
        assert!((own.size / word_px - 1.0).abs() < 1e-9 && own.p.is_none(), "{own:?}");
    }

    #[test]
    fn steps_of_matcher_and_driver_are_found_and_none_where_there_are_none() {
        let sensor = kinect_v1(1);
        let found = words(0.125, 0.0).lattice(&sensor, 43.5);
        assert!((found.disparity.unwrap().size / 0.125 - 1.0).abs() < 2e-3, "{found:?}");
        let found = words(0.0, 0.001).lattice(&sensor, 43.5);
        assert_eq!((found.depth.map(|step| step.size), found.disparity), (Some(0.001), None));
        for rounding in [0.00045, 0.000907, 0.00121, 0.0123] {
            let found = words(0.0, rounding).lattice(&sensor, 43.5);
            let step = found.depth.expect("a step that is no whole number of units");
            assert!((step.size / rounding - 1.0).abs() < 1e-4, "{rounding}: {found:?}");
            assert!(found.disparity.is_none() && step.p.is_some_and(|p| p < 1e-9));
        }
        assert_eq!(words(0.0, 0.0).lattice(&sensor, 43.5), Quantisation::default());
    }
}
