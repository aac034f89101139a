//! Small statistics the pipeline shares.

mod binomial;
mod correlation;
mod quantile;
mod truncated;

pub use binomial::{at_least, at_most, clopper_pearson};
pub use correlation::{Correlation, measure_correlation};
pub use quantile::quantile;
pub use truncated::{normal_cut_factor, std_unbias};

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

/// Two-sided quantile of Student's t: P(|T| < q) = `level`.
pub fn student_quantile(level: f64, degrees_of_freedom: f64) -> f64 {
    let p = 0.5 + 0.5 * level;
    // Beyond this the two agree to six digits, and the inverse of Student's t takes for ever.
    if degrees_of_freedom > 1e6 {
        return Normal::standard().inverse_cdf(p);
    }
    StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0)).map_or(f64::NAN, |t| t.inverse_cdf(p))
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
}
