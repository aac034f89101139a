//! Small statistics shared by the pipeline.

mod budget;
mod correlation;
mod paule_mandel;
mod random_effects;
mod summed_area;

pub use budget::{
    Budget, COVERAGE_FACTOR, Component, Distribution, Evaluation, rounding_uncertainty,
};
#[cfg(test)]
pub use correlation::noise_through_boxes;
pub use correlation::{Correlation, LONGEST_LAG, measure_correlation};
pub use paule_mandel::{between, paule_mandel};
pub use random_effects::{RandomEffects, common_value};
pub use summed_area::SummedArea;

use std::f64::consts::PI;

use statrs::distribution::{Beta, ContinuousCDF, Normal, StudentsT};
use statrs::function::beta::checked_beta_reg;
use statrs::function::erf::erfc;

/// The median absolute deviation of a Gaussian times this is its standard deviation:
/// 1/Phi^-1(3/4), Phi the standard normal distribution.
pub const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

/// Standard deviations at which Tukey's biweight reaches zero: 95 % efficient on Gaussian noise.
pub const TUKEY: f64 = 4.685;

/// `n` evenly spaced values from `low` to `high`, both included.
pub fn even([low, high]: [f64; 2], n: usize) -> impl Iterator<Item = f64> + Clone {
    (0..n).map(move |k| low + (high - low) * k as f64 / (n - 1) as f64)
}

/// Minimum and maximum; `[INFINITY, NEG_INFINITY]` when there are no values.
pub fn range(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    values
        .into_iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

/// Brackets the point where `below` turns false, by fifty bisections: its lower and upper bound.
pub fn bisect([mut low, mut high]: [f64; 2], below: impl Fn(f64) -> bool) -> [f64; 2] {
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if below(middle) { low = middle } else { high = middle }
    }
    [low, high]
}

/// Greatest common divisor.
pub fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The first stride from `stride` on without a common divisor with `n`: its multiples modulo `n` are all of 0..n.
pub fn coprime(stride: usize, n: usize) -> usize {
    (stride..).find(|&stride| gcd(stride, n) == 1).unwrap_or(1)
}

/// Mean of the finite values, if any.
pub fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut n) = (0.0, 0.0);
    for v in values.filter(|v| v.is_finite()) {
        sum += v;
        n += 1.0;
    }
    (n > 0.0).then(|| sum / n)
}

/// Mean square of the finite values, if any.
pub fn mean_square<'a>(values: impl IntoIterator<Item = &'a f32>) -> Option<f64> {
    mean(values.into_iter().map(|v| f64::from(*v).powi(2)))
}

/// Median by selection, the upper of two middle values; NaN when empty. The slice is reordered.
pub fn median_in_place(values: &mut [f32]) -> f32 {
    let n = values.len();
    if n == 0 {
        return f32::NAN;
    }
    *values.select_nth_unstable_by(n / 2, f32::total_cmp).1
}

/// The middle value, or the mean of the two middle values; NaN when empty. Reorders `values`.
pub fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 {
        return upper;
    }
    0.5 * (upper + below.iter().copied().fold(f64::NEG_INFINITY, f64::max))
}

/// The `p`-quantile, 0 to 1, by interpolation between the sorted values (Hyndman and Fan's type 7);
/// `None` when empty. Sorts `values`, which must hold no NaN.
pub fn quantile(values: &mut [f64], p: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let at = p * (values.len().checked_sub(1)?) as f64;
    let (i, rest) = (at.floor() as usize, at.fract());
    let next = values.get(i + 1).unwrap_or(&values[i]);
    Some(values[i] + rest * (next - values[i]))
}

/// Two-sided quantile of Student's t: P(|T| < q) = `level`.
pub fn student_quantile(level: f64, degrees_of_freedom: f64) -> f64 {
    let p = 0.5 + 0.5 * level;
    // Beyond this the normal quantile agrees to six digits, and inverting Student's t takes for ever.
    if degrees_of_freedom > 1e6 {
        return Normal::standard().inverse_cdf(p);
    }
    StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0)).map_or(f64::NAN, |t| t.inverse_cdf(p))
}

/// P(|T| < k) of Student's t; `None` means infinite degrees of freedom.
pub fn student_coverage(k: f64, degrees_of_freedom: Option<f64>) -> f64 {
    let beyond = match degrees_of_freedom.filter(|n| *n < 1e6) {
        None => Normal::standard().sf(k),
        Some(n) => StudentsT::new(0.0, 1.0, n).map_or(f64::NAN, |t| t.sf(k)),
    };
    1.0 - 2.0 * beyond
}

/// P(T > t) of Student's t; 1 without degrees of freedom, or where t is not a number.
pub fn student_upper(t: f64, degrees_of_freedom: f64) -> f64 {
    if t.is_nan() {
        return 1.0;
    }
    StudentsT::new(0.0, 1.0, degrees_of_freedom).map_or(1.0, |law| law.sf(t))
}

/// Variance of a standard normal truncated at +-`cut`: below one, tends to one.
///
/// 1 - 2 k phi(k) / (2 Phi(k) - 1) (Johnson, Kotz and Balakrishnan 1994, section 13.10).
pub fn normal_cut_factor(cut: f64) -> f64 {
    let density = (-0.5 * cut * cut).exp() / (2.0 * PI).sqrt();
    let inside = 2.0 * Normal::standard().cdf(cut) - 1.0;
    1.0 - 2.0 * cut * density / inside
}

/// Factor that unbiases the root of an unbiased variance of `n` effective samples:
/// `E[s] = sigma (1 - 1/(4 n))` to first order.
pub fn std_unbias(n: f64) -> f64 {
    if n > 1.0 { 1.0 + 1.0 / (4.0 * n) } else { 1.0 }
}

/// Interval of Clopper and Pearson (1934) for the rate behind `k` successes of `n`: it covers the true
/// rate with a probability of at least `level`. [0, 1] when `n` is 0.
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

/// P(|X| > t) of a standard normal.
pub fn normal_beyond(t: f64) -> f64 {
    erfc(t * std::f64::consts::FRAC_1_SQRT_2)
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

/// P(F > f) of Fisher's F with these degrees of freedom.
pub fn f_upper(f: f64, above: f64, below: f64) -> f64 {
    // Past a million degrees of freedom the result is the same to six digits.
    let below = below.min(1e6);
    beta(0.5 * below, 0.5 * above, below / (below + above * f.max(0.0)))
}

fn beta(a: f64, b: f64, x: f64) -> f64 {
    checked_beta_reg(a, b, x.clamp(0.0, 1.0)).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn student_quantiles_match_the_tables() {
        assert!((student_quantile(0.95, 10.0) - 2.228).abs() < 1e-3);
        assert!((student_quantile(0.95, 1e9) - 1.960).abs() < 1e-3);
    }

    /// Table values at 5 %, at 2.56 %, and at 1 % with infinite degrees of freedom below.
    #[test]
    fn tails_of_f_match_the_tables() {
        for (f, above, below, p) in [(4.965, 1.0, 10.0, 0.05), (2.711, 5.0, 20.0, 0.05)] {
            assert!((f_upper(f, above, below) / p - 1.0).abs() < 2e-3, "{f}");
        }
        assert!((f_upper(3.782, 2.0, 120.0) - 0.0256).abs() < 1e-3);
        assert!((f_upper(6.635, 1.0, 1e9) / 0.01 - 1.0).abs() < 2e-3);
        assert_eq!(f_upper(0.0, 3.0, 9.0), 1.0);
    }

    #[test]
    fn the_robust_scale_is_the_inverse_of_the_upper_quartile() {
        assert!((MAD_TO_SIGMA * Normal::standard().inverse_cdf(0.75) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_median_of_nothing_is_nan() {
        assert!(median_in_place(&mut []).is_nan());
        assert_eq!(median_in_place(&mut [3.0, 1.0, 2.0]), 2.0);
    }

    /// By hand: the value at index p (n - 1) of the five sorted ones.
    #[test]
    fn quantiles_lie_between_the_sorted_values() {
        let mut values = [7.0, 1.0, 4.0, 2.0, 11.0];
        let known = [(0.0, 1.0), (0.1, 1.4), (0.25, 2.0), (0.5, 4.0), (0.9, 9.4), (1.0, 11.0)];
        for (p, expected) in known {
            assert!((quantile(&mut values, p).unwrap() - expected).abs() < 1e-12, "{p}");
        }
        assert_eq!(values, [1.0, 2.0, 4.0, 7.0, 11.0], "sorted");
        assert_eq!(quantile(&mut [3.0], 0.7), Some(3.0));
        assert_eq!(quantile(&mut [], 0.5), None);
    }

    /// For even and odd counts.
    #[test]
    fn the_half_is_the_median() {
        for n in 1..20 {
            let mut values: Vec<f64> = (0..n).map(|i| f64::from(i * 7 % 20).sin()).collect();
            let middle = median(&mut values.clone());
            assert!((quantile(&mut values, 0.5).unwrap() - middle).abs() < 1e-15);
        }
    }

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

    /// 95 % intervals (k, n, low, high) in percent, from tables of the exact binomial.
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
