//! Variance of a Gaussian whose tails were cut, and small-sample bias of a standard deviation.

use std::f64::consts::PI;

use statrs::distribution::{ContinuousCDF, Normal};

/// Variance of a standard normal kept only within +-`cut`: below one, tends to one.
///
/// 1 - 2 k phi(k) / (2 Phi(k) - 1) (Johnson, Kotz and Balakrishnan 1994, section 13.10).
pub fn normal_cut_factor(cut: f64) -> f64 {
    let density = (-0.5 * cut * cut).exp() / (2.0 * PI).sqrt();
    let inside = 2.0 * Normal::standard().cdf(cut) - 1.0;
    1.0 - 2.0 * cut * density / inside
}

/// The root of an unbiased variance with `n` effective samples is low by this factor:
/// `E[s] = sigma (1 - 1/(4 n))` to first order.
pub fn std_unbias(n: f64) -> f64 {
    if n > 1.0 { 1.0 + 1.0 / (4.0 * n) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cut_factor_matches_numerical_integration() {
        for cut in [1.0f64, 2.0, 3.5] {
            let n = 200_000;
            let (mut mass, mut second) = (0.0, 0.0);
            for i in 0..n {
                let t = -cut + 2.0 * cut * (i as f64 + 0.5) / n as f64;
                let p = (-0.5 * t * t).exp();
                mass += p;
                second += p * t * t;
            }
            assert!((normal_cut_factor(cut) - second / mass).abs() < 1e-8, "{cut}");
        }
    }
}
