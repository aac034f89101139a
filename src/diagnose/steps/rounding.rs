//! What rounding to steps leaves in each view: waves as long as a step, in the mean and in the size of the
//! noise. They follow from the words and are no error of the sensor's own.

use std::f64::consts::{PI, TAU};

use super::lattice::Step;
use crate::stats::bisect;
use crate::terms::{GroupMean, PixelContext};

/// Steps of the stored depths, whose waves the searches of the mean and of the noise fit in each view.
///
/// Rounding x, with Gaussian noise of r steps on it, errs by the sum over k of (-1)^k sin(2 pi k x) / (pi k)
/// exp(-2 (pi k r)^2) steps (Widrow and Kollar, Quantization Noise, 2008). Two waves are all of it but for
/// steps beyond four sigmas.
#[derive(Debug, Clone, Copy)]
pub struct Rounding(Step);

/// Amplitude that no view shows, in sigmas: a hundredth of the error of a mean over ten thousand readings.
const UNSEEN: f64 = 1e-4;

impl Rounding {
    /// Columns of [`Rounding::of_mean`] and [`Rounding::of_log_variance`].
    pub const COLUMNS: usize = 4;

    /// `None` where noise hides the steps everywhere.
    pub fn of<'a>(
        step: Option<Step>,
        places: impl IntoIterator<Item = &'a PixelContext>,
    ) -> Option<Self> {
        let rounding = Rounding(step?);
        let shows = |p: &PixelContext| {
            let step_px = rounding.step_px(p);
            step_px * wave(1.0, noise(step_px, p.variance)) > UNSEEN * p.variance.sqrt()
        };
        places.into_iter().any(shows).then_some(rounding)
    }

    /// Both phases of each wave in the mean of a patch, as large as the whole wave may be, px.
    pub fn of_mean(&self, p: &PixelContext) -> [f64; Self::COLUMNS] {
        let step_px = self.step_px(p);
        let size = |k: f64| step_px * wave(k, noise(step_px, p.variance));
        let [first, second] = [1.0, 2.0].map(|k| self.phases(k, p).map(|phase| size(k) * phase));
        [first[0], first[1], second[0], second[1]]
    }

    /// Same in the log variance of a group of patches, with the level that they leave it at. Only single frames
    /// show what is the same in all of them.
    pub fn of_log_variance(
        &self,
        places: &[PixelContext],
        mean: &GroupMean<'_>,
        between_frames: bool,
    ) -> ([f64; Self::COLUMNS], f64) {
        let of = |phase: usize| mean(&|i| self.of_variance(&places[i])[phase]);
        let [sin, cos] = [of(0), of(1)];
        // ln(1 + v cos x) is -ln(1 + q^2) and the sum over k of (-1)^(k + 1) 2 q^k / k cos(k x), where
        // v = 2 q / (1 + q^2).
        let v = sin.hypot(cos).clamp(f64::MIN_POSITIVE, 1.0);
        let q = v / (1.0 + (1.0 - v * v).sqrt());
        let first = [sin, cos].map(|phase| 2.0 * q / v * phase);
        // The square of the mean's wave, which the variance lacks, has twice its frequency.
        let still =
            |i: usize| correlation_of_rounding(self.step_px(&places[i]), places[i].variance);
        let beside = |phase: usize| mean(&|i| still(i) * self.phases(2.0, &places[i])[phase]);
        let twice = [2.0 * sin * cos, cos * cos - sin * sin].map(|phase| (q / v).powi(2) * phase);
        let lost = if between_frames { mean(&still) } else { 0.0 };
        let level = (-lost).ln_1p() - (q * q).ln_1p();
        ([first[0], first[1], twice[0] + beside(0), twice[1] + beside(1)], level)
    }

    /// Both phases of the variance's wave in a patch, relative to the variance.
    fn of_variance(&self, p: &PixelContext) -> [f64; 2] {
        let r2 = noise(self.step_px(p), p.variance);
        let size = (PI.powi(-2) + 4.0 * r2) * (-2.0 * PI * PI * r2).exp() / (r2 + 1.0 / 12.0);
        self.phases(1.0, p).map(|phase| size * phase)
    }

    /// Sine and cosine of wave `k`, averaged over the pixels of a patch.
    fn phases(&self, k: f64, p: &PixelContext) -> [f64; 2] {
        let place = if self.0.is_of_depth { p.z } else { p.disparity };
        let (sin, cos) = (k * TAU * place / self.0.size).sin_cos();
        let along = |slope: &f64| averaged(k * slope / self.step_px(p), p.side);
        let kept: f64 = p.slope.iter().map(along).product();
        [kept * sin, kept * cos]
    }

    fn step_px(&self, p: &PixelContext) -> f64 {
        self.0.px(p.disparity * p.z, p.z)
    }
}

/// Largest share of the variance that is taken for rounding. Where the noise is small against a step, a pixel's
/// error of rounding hardly changes from frame to frame.
const MAX_SHARE: f64 = 0.5;

/// Share of the variance of words of this step (px^2) that is the error of rounding.
pub fn share_of_rounding(step_px: f64, variance: f64) -> f64 {
    (step_px.powi(2) / 12.0 / variance.max(1e-12)).min(MAX_SHARE)
}

/// Correlation before rounding of two frames whose words, of this step and variance (px^2), correlate by
/// `stored`. `None` where rounding is more than half of the variance: in a target that lies in one step its error
/// does not vary from pixel to pixel, and this correlation would then be wrong by more than .02.
pub fn before_rounding(stored: f64, step_px: f64, variance: f64) -> Option<f64> {
    if step_px <= 0.0 {
        return Some(stored);
    }
    let r2 = noise(step_px, variance);
    (r2 > 1.0 / 12.0).then(|| bisect([-1.0, 1.0], |rho| of_words(rho, r2) < stored)[0])
}

/// Share of the noise variance (px^2) that all frames have in common where they are rounded to this step.
pub fn correlation_of_rounding(step_px: f64, variance: f64) -> f64 {
    if step_px <= 0.0 {
        return 0.0;
    }
    of_words(0.0, noise(step_px, variance))
}

/// Correlation of two frames' words where that of their noise, of variance `r2` (steps^2), is `rho`.
fn of_words(rho: f64, r2: f64) -> f64 {
    // The errors of rounding covary by the noise that is not common.
    let rounding: f64 =
        [1.0, 2.0, 3.0, 4.0].map(|k| 0.5 * wave(k, r2 * (1.0 - rho)).powi(2)).iter().sum();
    (r2 * rho + rounding) / (r2 + 1.0 / 12.0)
}

/// Variance of the noise before it is rounded, steps^2; sigma holds the error of rounding.
fn noise(step_px: f64, variance: f64) -> f64 {
    (variance / step_px.powi(2) - 1.0 / 12.0).max(0.0)
}

/// Amplitude of wave `k` of the mean, steps.
fn wave(k: f64, r2: f64) -> f64 {
    (-2.0 * (PI * k).powi(2) * r2).exp() / (PI * k)
}

/// Mean of a wave of `frequency` (cycles per px) over `side` pixels about the middle, of its value there.
fn averaged(frequency: f64, side: f64) -> f64 {
    let half = PI * frequency;
    // Whole cycles from pixel to pixel: all pixels have the same phase.
    if half.sin().abs() < 1e-9 {
        return (side * half).cos() / half.cos();
    }
    (side * half).sin() / (side * half.sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::mean;

    const STEP: f64 = 0.13;

    fn rounding(size: f64) -> Option<Step> {
        Some(Step { is_of_depth: false, size, p: None })
    }

    /// A pixel's place `x` steps from the sensor, with noise of `r` steps before it is rounded.
    fn place(x: f64, r: f64) -> PixelContext {
        let variance = (r * r + 1.0 / 12.0) * STEP * STEP;
        PixelContext { disparity: x * STEP, variance, side: 1.0, ..Default::default() }
    }

    /// Mean and variance of rounded Gaussian noise of `r` steps about `x`, steps, by quadrature.
    fn rounded(x: f64, r: f64) -> [f64; 2] {
        const N: i32 = 200_000;
        let at = |k: i32| f64::from(k) * 12.0 / f64::from(N) - 6.0;
        let [mut sum, mut mean, mut square] = [0.0; 3];
        for t in (0..=N).map(at) {
            let (w, word) = ((-0.5 * t * t).exp(), (x + r * t).round() - x);
            (sum, mean, square) = (sum + w, mean + w * word, square + w * word * word);
        }
        [mean / sum, square / sum - (mean / sum).powi(2)]
    }

    /// The columns take out all but a few per cent of what rounding does, and are as large as they say.
    fn explained(r: f64, values: &[f64], columns: &[[f64; Rounding::COLUMNS]]) {
        let rms = |of: &[f64]| of.iter().map(|y| y * y).sum::<f64>().sqrt();
        let mut left = values.to_vec();
        for k in 0..Rounding::COLUMNS {
            let own: f64 = columns.iter().map(|c| c[k] * c[k]).sum();
            let size = columns.iter().zip(values).map(|(c, y)| c[k] * y).sum::<f64>() / own;
            // The quadrature errs by less than a hundredth.
            let most = 1.2 * own.sqrt() + 0.01 * rms(values);
            assert!(size.abs() * own.sqrt() < most, "r = {r}: column {k} times {size}");
            left.iter_mut().zip(columns).for_each(|(y, c)| *y -= size * c[k]);
        }
        assert!(rms(&left) < 0.15 * rms(values), "r = {r}: {} of {}", rms(&left), rms(values));
    }

    #[test]
    fn waves_are_those_of_rounded_noise() {
        const PHASES: usize = 40;
        for r in [0.25, 0.3, 0.35, 0.45] {
            let known = Rounding::of(rounding(STEP), &[place(0.0, r)]).expect("steps that show");
            let phase = |k: usize| 7.0 + (k as f64 + 0.5) / PHASES as f64;
            let places: Vec<PixelContext> = (0..PHASES).map(|k| place(phase(k), r)).collect();
            let truth: Vec<[f64; 2]> = (0..PHASES).map(|k| rounded(phase(k), r)).collect();
            let of_mean: Vec<f64> = truth.iter().map(|t| STEP * t[0]).collect();
            explained(r, &of_mean, &places.iter().map(|p| known.of_mean(p)).collect::<Vec<_>>());
            let whole = r * r + 1.0 / 12.0;
            let still = mean(truth.iter().map(|t| t[0].powi(2) / whole)).unwrap();
            approx::assert_relative_eq!(
                correlation_of_rounding(STEP, places[0].variance),
                still,
                max_relative = 0.1
            );
            let columns: Vec<([f64; Rounding::COLUMNS], f64)> =
                places.iter().map(|p| known.of_log_variance(&[*p], &|of| of(0), true)).collect();
            let log = truth.iter().zip(&columns).map(|(t, (_, level))| (t[1] / whole).ln() - level);
            let log: Vec<f64> = log.collect();
            let level = mean(log.iter().copied()).unwrap();
            assert!(level.abs() < 0.15 * log[0].abs(), "r = {r}: level {level}");
            explained(r, &log, &columns.iter().map(|c| c.0).collect::<Vec<_>>());
        }
    }

    /// Patches of pixels on planes of any slope, also where a pixel is a whole step further.
    #[test]
    fn a_patch_holds_the_mean_of_its_pixels() {
        for (slope, side) in [(0.0, 4.0), (0.02, 4.0), (0.09, 24.0), (0.13, 4.0), (0.13, 3.0)] {
            let at = |more: f64, side: f64| PixelContext {
                slope: [slope, 0.0],
                side,
                ..place(308.0 + more / STEP, 0.3)
            };
            let known = Rounding::of(rounding(STEP), &[at(0.0, 1.0)]).expect("steps that show");
            let pixel = |k: usize| known.of_mean(&at(slope * (k as f64 - 0.5 * (side - 1.0)), 1.0));
            let patch = known.of_mean(&at(0.0, side));
            for (k, whole) in patch.into_iter().enumerate() {
                let sum: f64 = (0..side as usize).map(|i| pixel(i)[k]).sum();
                approx::assert_abs_diff_eq!(whole, sum / side, epsilon = 1e-9);
            }
        }
    }

    #[test]
    fn fine_steps_leave_nothing() {
        let fine = place(0.0, 3.0);
        assert!(Rounding::of(rounding(STEP), &[fine]).is_none());
        assert!(Rounding::of(None, &[place(0.0, 0.3)]).is_none());
    }
}
