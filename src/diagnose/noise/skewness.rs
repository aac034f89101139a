//! Detects errors that reach farther to one side than to the other.

use super::some_views::some_views;
use super::structure::Structure;
use super::texture_finding::TextureFinding;
use super::view_mean::{ViewMean, nats};
use crate::diagnose::finding::parameters::one;
use crate::terms::{Axis, Statistic};

/// Least skewness reported. A slight bend of the disparity, as by a window that averages over depths, makes
/// as much as the step from disparity to depth: .05 for a Kinect at 4 m (6 times its relative sigma).
const MIN_SKEWNESS: f64 = 0.05;

/// Tests all views or some, in both disparity and depth: noise that is symmetric in
/// one is skewed in the other.
pub fn skewness(views: &[Structure], level: f64) -> Option<TextureFinding> {
    [1.0, -1.0].into_iter().find_map(|sign| to_side(views, sign, level))
}

/// Tests for skewness towards large disparities (`sign` 1) or small ones (-1).
fn to_side(views: &[Structure], sign: f64, level: f64) -> Option<TextureFinding> {
    let of =
        |s: &Structure| s.skewness()?.map(|skew| sign * skew).into_iter().min_by(f64::total_cmp);
    let m = ViewMean::of(views, of)?;
    // Two sides, and all views or some for each.
    let p = 4.0 * m.p_above(0.0);
    if m.value >= MIN_SKEWNESS && p <= level {
        return Some(found(&m, sign, p));
    }
    let some = some_views(views, of, None).filter(|some| 4.0 * some.p <= level)?;
    let m = ViewMean::of(&some.views, of).filter(|m| m.value >= MIN_SKEWNESS)?;
    Some(found(&m, sign, 4.0 * some.p).of_some([some.views.len(), some.of], 4.0 * some.p))
}

fn found(m: &ViewMean, sign: f64, p: f64) -> TextureFinding {
    let side = if sign > 0.0 { "large disparities" } else { "small disparities" };
    TextureFinding {
        parameters: one("skewness", sign * m.value, m.std_error),
        // Deviation from a Gaussian of the same variance, to first order in Hermite polynomials.
        size_sigma: m.value / 6f64.sqrt(),
        p,
        nats: nats(m, 0.0),
        words: Some(format!("errors reach farther to {side} than to the other side")),
        ..TextureFinding::named(vec![], Statistic::Distribution, Axis::Residual)
    }
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, Gamma};

    use super::*;
    use crate::diagnose::noise::tests::{drawn, gaussian_in_depth, normal};

    /// A gamma distribution of shape k has a skewness of 2 / sqrt(k).
    #[test]
    fn a_gamma_distribution_is_skewed_and_a_gaussian_is_not() {
        const SHAPE: f64 = 100.0;
        let gamma = Gamma::new(SHAPE, 1.0).unwrap();
        let skewed = drawn("gamma", 0.001, |_, rng| (gamma.sample(rng) - SHAPE) / SHAPE.sqrt());
        let found = skewness(&skewed, 1e-3).expect("skewed");
        let told = found.parameters["skewness"]["value"].as_f64().unwrap();
        // Four standard errors of 420,000 readings, plus what the cut at 4.5 sigma removes.
        assert!((told - 0.194).abs() < 0.02, "{told}");
        assert!(skewness(&drawn("gaussian", 0.001, |_, rng| normal(rng)), 1e-3).is_none());
    }

    /// Gaussian noise of 3 % of the depth is skewed in the disparity only.
    #[test]
    fn what_is_symmetric_in_the_depth_is_not_skewed() {
        const S: f64 = 0.03;
        let in_disparity = drawn("depth", S, |_, rng| gaussian_in_depth(S, rng));
        let told = in_disparity[0].skewness().unwrap();
        assert!(told[0] > 0.12 && told[1].abs() < 0.06, "{told:?}");
        assert!(skewness(&in_disparity, 1e-3).is_none());
    }
}
