//! Counts of successes: exact intervals and exact tests.

use statrs::distribution::{Beta, ContinuousCDF};
use statrs::function::beta::checked_beta_reg;

/// Interval of Clopper and Pearson (1934) for the rate behind `k` successes of `n`: it holds the true
/// rate with at least the probability `level`. All of [0, 1] when nothing was tried.
pub fn clopper_pearson(k: usize, n: usize, level: f64) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    let (k, n, tail) = (k.min(n) as f64, n as f64, 0.5 * (1.0 - level));
    let quantile = |a: f64, b: f64, p: f64| Beta::new(a, b).map_or(f64::NAN, |d| d.inverse_cdf(p));
    let low = if k > 0.0 { quantile(k, n - k + 1.0, tail) } else { 0.0 };
    let high = if k < n { quantile(k + 1.0, n - k, 1.0 - tail) } else { 1.0 };
    [low, high]
}

/// P(X <= k) of a binomial with `n` trials and rate `p`.
pub fn at_most(k: usize, n: usize, p: f64) -> f64 {
    if k >= n { 1.0 } else { beta(n as f64 - k as f64, k as f64 + 1.0, 1.0 - p) }
}

/// P(X >= k) of a binomial with `n` trials and rate `p`.
pub fn at_least(k: usize, n: usize, p: f64) -> f64 {
    if k == 0 {
        1.0
    } else if k > n {
        0.0
    } else {
        beta(k as f64, (n - k) as f64 + 1.0, p)
    }
}

fn beta(a: f64, b: f64, x: f64) -> f64 {
    checked_beta_reg(a, b, x.clamp(0.0, 1.0)).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 95 % intervals of (found, asked), percent, as tables of the exact binomial have them.
    #[test]
    fn the_intervals_are_those_of_the_table() {
        let rows = [
            (0, 60, 0.0, 6.0),
            (0, 100, 0.0, 3.6),
            (4, 200, 0.5, 5.0),
            (10, 200, 2.4, 9.0),
            (36, 40, 76.0, 97.0),
            (54, 60, 80.0, 96.0),
            (90, 100, 82.0, 95.0),
            (285, 300, 92.0, 97.0),
        ];
        for (k, n, low, high) in rows {
            let [a, b] = clopper_pearson(k, n, 0.95);
            let digit = if high > 50.0 { 0.51 } else { 0.051 };
            assert!((100.0 * a - low).abs() < digit, "{k}/{n}: {a}");
            assert!((100.0 * b - high).abs() < digit, "{k}/{n}: {b}");
        }
        assert_eq!(clopper_pearson(0, 0, 0.95), [0.0, 1.0]);
        assert_eq!(clopper_pearson(5, 5, 0.95)[1], 1.0);
    }

    #[test]
    fn tails_are_sums_of_binomial_probabilities() {
        let (n, p) = (12usize, 0.3f64);
        let mut choose = 1.0;
        let mut sum = 0.0;
        for k in 0..=n {
            assert!((at_least(k, n, p) - (1.0 - sum)).abs() < 1e-9, "{k}");
            sum += choose * p.powi(k as i32) * (1.0 - p).powi((n - k) as i32);
            assert!((at_most(k, n, p) - sum).abs() < 1e-9, "{k}");
            choose *= (n - k) as f64 / (k + 1) as f64;
        }
    }
}
