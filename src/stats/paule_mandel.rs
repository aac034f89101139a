//! Variance beyond what sampling explains (Paule and Mandel 1982).

/// Chi-square of the views' means, given as (square, variance), and its derivative by tau_view^2.
pub fn between(means: &[(f64, f64)], tau_view2: f64) -> (f64, f64) {
    means.iter().fold((0.0, 0.0), |(chi2, slope), (square, variance)| {
        let weight = 1.0 / (variance + tau_view2);
        (chi2 + square * weight, slope - square * weight * weight)
    })
}

/// Relative step at which tau^2 has converged: far below any use, far above rounding.
const ROOT_DIGITS: f64 = 1e-12;
/// Newton's method takes about ten steps. From far off each doubles tau^2, and an `f64` spans a thousand
/// doublings.
const MAX_NEWTON_STEPS: usize = 1000;

/// The tau^2 >= 0 at which chi-square equals `expected`, or zero where it is already less there; `chi2`
/// returns chi-square and its slope. Newton's method: chi-square is decreasing and convex in tau^2, so
/// steps from zero never pass the root (DerSimonian and Kacker 2007).
pub fn paule_mandel(expected: f64, chi2: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut tau = 0.0;
    for _ in 0..MAX_NEWTON_STEPS {
        let (found, slope) = chi2(tau);
        let step = (expected - found) / slope;
        // Also stops at NaN and infinity, and keeps the last tau.
        if !(step > ROOT_DIGITS * tau && step.is_finite()) {
            break;
        }
        tau += step;
    }
    tau
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the root against its definition, from hardly any excess to a factor of a million.
    #[test]
    fn extra_variance_makes_chi_square_what_is_expected() {
        for size in [1.2, 3.0, 1e3, 1e6] {
            let means: Vec<(f64, f64)> = (0..12)
                .map(|i| {
                    let variance = 0.01 + 0.002 * f64::from(i);
                    (size * variance * (1.0 + 0.5 * f64::from(i).sin()), variance)
                })
                .collect();
            let tau = paule_mandel(12.0, |tau| between(&means, tau));
            assert!((between(&means, tau).0 / 12.0 - 1.0).abs() < 1e-9, "{size}: {tau}");
        }
        assert_eq!(paule_mandel(12.0, |tau| between(&[(0.01, 0.01); 11], tau)), 0.0);
    }

    /// NaN and infinity in the input never come back.
    #[test]
    fn no_number_in_gives_zero() {
        for square in [f64::NAN, f64::INFINITY] {
            assert_eq!(paule_mandel(1.0, |tau| between(&[(square, 0.1)], tau)), 0.0);
        }
    }
}
