//! Closed forms, in nats, of what knowing a cause is worth that shows in neither a mean nor a spread.

use std::f64::consts::{PI, TAU};

use statrs::function::gamma::ln_gamma;

use super::kernels::Window;

/// Minimum share of white noise, from the rounding of the stored words; without it the pixels of a smooth
/// window would determine one another exactly.
const ROUNDING: f64 = 1e-3;

/// Gain per pixel and frame of knowing that the variance is `ratio` times what is believed.
pub fn of_variance(ratio: f64) -> f64 {
    0.5 * (ratio - 1.0 - ratio.ln())
}

/// Gain of knowing that a number believed to be 0 has a variance of its own, `q` times that of its estimate;
/// the number itself stays unknown.
pub fn of_effect(q: f64) -> f64 {
    0.5 * (q - q.ln_1p())
}

/// Gain per pixel and view of `frames`: minus half the log determinant of their correlation.
pub fn of_average(weights: &[f64], frames: usize) -> f64 {
    let lag = |k: usize| weights.iter().skip(k).zip(weights).map(|(a, b)| a * b).sum::<f64>();
    let lags: Vec<f64> = (0..frames).map(lag).collect();
    // Durbin-Levinson recursion: innovation variance of each frame, given the earlier ones.
    let (mut known, mut left, mut gain) = (Vec::<f64>::new(), lags[0], 0.0);
    for k in 1..frames {
        let told: f64 = (1..k).map(|j| known[j - 1] * lags[k - j]).sum();
        let partial = (lags[k] - told) / left;
        let turned: Vec<f64> = known.iter().rev().map(|a| partial * a).collect();
        known.iter_mut().zip(turned).for_each(|(a, t)| *a -= t);
        known.push(partial);
        left *= 1.0 - partial * partial;
        gain -= 0.5 * left.ln();
    }
    gain
}

/// Gain per pixel and view of `frames` that have `share` of their variance in common.
pub fn of_frozen(share: f64, frames: usize) -> f64 {
    let others = frames as f64 - 1.0;
    -0.5 * (others * (-share).ln_1p() + (others * share).ln_1p())
}

/// Gain per pixel and frame of a field with `share` of its variance through `window`: minus half the mean
/// log of its spectrum.
pub fn of_window(window: &Window, share: f64) -> f64 {
    const STEPS: usize = 64;
    let power: Vec<f64> =
        (0..STEPS).map(|k| window.power(PI * (k as f64 + 0.5) / STEPS as f64)).collect();
    let log = |a: f64, b: f64| ((1.0 - share) + share * a * b).max(ROUNDING).ln();
    let sum: f64 = power.iter().map(|a| power.iter().map(|b| log(*a, *b)).sum::<f64>()).sum();
    -0.5 * sum / (STEPS * STEPS) as f64
}

/// Share and scale, in sigma, of the stray errors of any sensor. Tails must stand out from these; without
/// them one wild pixel would be worth a hundred nats, which nobody would believe.
const STRAYS: f64 = 1e-3;
const STRAY_SCALE: f64 = 4.0;

/// Gain per pixel and frame of Student's t of unit variance over a Gaussian, both with strays.
pub fn of_student(nu: f64) -> f64 {
    let log_norm = ln_gamma(0.5 * (nu + 1.0)) - ln_gamma(0.5 * nu) - 0.5 * (PI * (nu - 2.0)).ln();
    divergence(|x| (log_norm - 0.5 * (nu + 1.0) * (x * x / (nu - 2.0)).ln_1p()).exp())
}

/// Gain per pixel and frame of `fraction` of Laplace errors among Gaussian ones, both with strays.
pub fn of_strays(fraction: f64, scale: f64) -> f64 {
    divergence(|x| (1.0 - fraction) * bell(x) + fraction * laplace(x, scale))
}

fn bell(x: f64) -> f64 {
    (-0.5 * x * x).exp() / TAU.sqrt()
}

fn laplace(x: f64, scale: f64) -> f64 {
    (-x / scale).exp() / (2.0 * scale)
}

/// Kullback-Leibler divergence of a symmetric density, given at x > 0, from the Gaussian, with strays
/// mixed into both.
fn divergence(density: impl Fn(f64) -> f64) -> f64 {
    // x = sinh(t): fine in the middle, far in the tails; the midpoint rule is exact for such functions.
    const STEP: f64 = 0.01;
    const END: f64 = 8.0;
    let at = |k: usize| {
        let t = (k as f64 + 0.5) * STEP;
        let x = t.sinh();
        let strays = STRAYS * laplace(x, STRAY_SCALE);
        let told = (1.0 - STRAYS) * density(x) + strays;
        let believed = (1.0 - STRAYS) * bell(x) + strays;
        // Nothing to add where the density underflows.
        if believed <= 0.0 { 0.0 } else { 2.0 * STEP * t.cosh() * told * (told / believed).ln() }
    };
    (0..(END / STEP) as usize).map(at).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Correlations of a moving average of two end after one lag: the determinant is 1 - rho^2 for two
    /// frames and 1 - 2 rho^2 for three.
    #[test]
    fn a_moving_average_is_worth_its_determinant() {
        let norm = (1.0f64 + 0.36).sqrt();
        let weights = [1.0 / norm, 0.6 / norm];
        let rho2 = (0.6f64 / 1.36).powi(2);
        assert!((of_average(&weights, 2) + 0.5 * (1.0 - rho2).ln()).abs() < 1e-12);
        assert!((of_average(&weights, 3) + 0.5 * (1.0 - 2.0 * rho2).ln()).abs() < 1e-12);
        assert_eq!(of_average(&weights, 1), 0.0);
        assert!((of_frozen(0.5, 2) + 0.5 * 0.75f64.ln()).abs() < 1e-12);
    }

    /// Weak correlation is worth a quarter of the sum over all other lags of rho^2; weak tails are worth the
    /// squared excess kurtosis over 48.
    #[test]
    fn what_is_weak_is_worth_its_squares() {
        let squares = (1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 9.0f64)).powi(2) - 1.0;
        let share = 0.002;
        let weak = 0.25 * share * share * squares;
        assert!((of_window(&Window::flat(3.0), share) / weak - 1.0).abs() < 0.02);
        let kurtosis: f64 = 6.0 / (400.0 - 4.0);
        assert!((0.8..1.1).contains(&(of_student(400.0) / (kurtosis * kurtosis / 48.0))));
        assert!(of_strays(1e-9, 4.0) < 1e-12);
    }
}
