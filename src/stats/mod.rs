//! Small statistics the pipeline shares.

mod binomial;
mod correlation;

pub use binomial::{at_least, at_most, clopper_pearson};
pub use correlation::{Correlation, measure_correlation};

use std::f64::consts::PI;

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// The median absolute deviation of a Gaussian times this is its standard deviation:
/// 1/Phi^-1(3/4), Phi the standard normal distribution.
pub const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

/// Least and greatest; infinite and the wrong way round when there are none.
pub fn range(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    values
        .into_iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

/// Median by selection; NaN when empty. The slice is reordered.
pub fn median_in_place(values: &mut [f32]) -> f32 {
    let n = values.len();
    if n == 0 {
        return f32::NAN;
    }
    *values.select_nth_unstable_by(n / 2, f32::total_cmp).1
}

/// The middle value, or the mean of the two in the middle; NaN of nothing. Reorders `values`.
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
/// `None` of nothing. Sorts `values`, which hold no NaN.
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
    // Beyond this the two agree to six digits, and the inverse of Student's t takes for ever.
    if degrees_of_freedom > 1e6 {
        return Normal::standard().inverse_cdf(p);
    }
    StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0)).map_or(f64::NAN, |t| t.inverse_cdf(p))
}

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
    fn student_quantiles_match_the_tables() {
        assert!((student_quantile(0.95, 10.0) - 2.228).abs() < 1e-3);
        assert!((student_quantile(0.95, 1e9) - 1.960).abs() < 1e-3);
    }

    #[test]
    fn the_robust_scale_is_the_inverse_of_the_upper_quartile() {
        approx::assert_relative_eq!(
            MAD_TO_SIGMA * Normal::standard().inverse_cdf(0.75),
            1.0,
            max_relative = 1e-12
        );
    }

    #[test]
    fn the_median_of_nothing_is_nan() {
        assert!(median_in_place(&mut []).is_nan());
        assert_eq!(median_in_place(&mut [3.0, 1.0, 2.0]), 2.0);
    }

    /// By hand: value p (n - 1), counted from 0, of the sorted five.
    #[test]
    fn quantiles_lie_between_the_sorted_values() {
        let mut values = [7.0, 1.0, 4.0, 2.0, 11.0];
        for (p, expected) in
            [(0.0, 1.0), (0.1, 1.4), (0.25, 2.0), (0.5, 4.0), (0.9, 9.4), (1.0, 11.0)]
        {
            approx::assert_relative_eq!(
                quantile(&mut values, p).unwrap(),
                expected,
                epsilon = 1e-12
            );
        }
        assert_eq!(values, [1.0, 2.0, 4.0, 7.0, 11.0], "sorted");
        assert_eq!(quantile(&mut [3.0], 0.7), Some(3.0));
        assert_eq!(quantile(&mut [], 0.5), None);
    }

    /// The middle is the median, of even and odd numbers.
    #[test]
    fn the_half_is_the_median() {
        for n in 1..20 {
            let mut values: Vec<f64> = (0..n).map(|i| f64::from(i * 7 % 20).sin()).collect();
            let middle = median(&mut values.clone());
            approx::assert_relative_eq!(
                quantile(&mut values, 0.5).unwrap(),
                middle,
                epsilon = 1e-15
            );
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
}
