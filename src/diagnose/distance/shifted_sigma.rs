//! Sigma at a shifted distance. Where a law shifts all distances, a model's sigma is evaluated at the wrong
//! depth, and the noise seems to follow another law of the depth: an echo of the law, and no cause.

use crate::diagnose::diagnosis::Finding;
use crate::diagnose::finding::scene::Scene;
use crate::diagnose::views::known::KnownTerms;
use crate::model::SigmaModel;
use crate::terms::{Axis, PixelContext, Statistic};

/// A finding is an echo if less than this share of it, RMS, is left beside the predicted one.
const HALF: f64 = 0.5;
/// Step of the numerical derivative, as a share of the depth.
const STEP: f64 = 1e-3;

/// Drops laws of the noise over depth that the laws of the distance, found or known, predict.
/// `scene` is that of the variance.
pub fn forget_shifted_sigma(
    found: &mut Vec<Finding>,
    scene: &Scene<'_>,
    sigma: &SigmaModel,
    known: &KnownTerms,
) {
    let mut laws = known.clone();
    for f in found.iter().filter(|f| f.contradicted.is_none()) {
        for (id, name) in LAWS {
            if let Some(value) = f.value(name).filter(|_| f.effect == Some(id)) {
                laws.learn(id, name, value);
            }
        }
    }
    let laws = &laws;
    let echo = |noise: Noise| {
        move |p: &PixelContext| log_variance(noise, p, scene.scale_px_m, sigma, laws)
    };
    let echoes = [Noise::OfDisparity, Noise::OfDepth].map(echo);
    found.retain(|f| {
        let of_depth = f.statistic == Statistic::Variance && f.axis == Axis::Z;
        !of_depth || f.terms.is_empty() || !echoes.iter().any(|echo| is_echo(f, scene, echo))
    });
}

/// Parameters of the laws of the distance.
const LAWS: [(&str, &str); 4] = [
    ("depth-scale", "scale"),
    ("disparity-offset", "offset_px"),
    ("thermal-drift", "relative"),
    ("thermal-drift", "time_constant_s"),
];

/// Where the noise arises; a recording does not tell.
#[derive(Debug, Clone, Copy)]
enum Noise {
    /// Before the law, which scales it as it scales small differences of depth.
    OfDisparity,
    /// In the depth itself, after the law.
    OfDepth,
}

/// Log ratio of the noise's variance to the model's at the measured depth, if the noise is the model's at the
/// true depth.
fn log_variance(
    noise: Noise,
    p: &PixelContext,
    px_m: f64,
    sigma: &SigmaModel,
    laws: &KnownTerms,
) -> f64 {
    let truth = |z: f64| z - laws.law_m(z, p.session_s, px_m);
    let z = truth(p.z);
    let stretch = match noise {
        Noise::OfDisparity => (truth(p.z * (1.0 + STEP)) - z) / (STEP * p.z),
        Noise::OfDepth => 1.0,
    };
    2.0 * (sigma.axial_sigma(z, p.theta) / stretch / sigma.axial_sigma(p.z, p.theta)).ln()
}

fn is_echo(f: &Finding, scene: &Scene<'_>, echo: impl Fn(&PixelContext) -> f64) -> bool {
    let (mut own, mut left) = (0.0, 0.0);
    for (view, values) in scene.data.iter().zip(scene.values(&f.terms)) {
        for ((p, value), w) in view.places.iter().zip(values).zip(&view.weight) {
            own += w * value * value;
            left += w * (value - echo(p)).powi(2);
        }
    }
    // Not a number where a law leaves no distance: no echo.
    left < HALF * HALF * own
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Form, NoiseModel};

    fn known(laws: &[(&str, &str, f64)]) -> KnownTerms {
        let mut known = KnownTerms::default();
        laws.iter().for_each(|(id, name, value)| known.learn(id, name, *value));
        known
    }

    /// Noise that is constant in the disparity is the same at any offset, and goes with a scale; that of Eq. 1
    /// grows with the true depth: 0.00151 + 0.00215 (z - 0.483)^2.
    #[test]
    fn the_noise_is_that_of_the_true_depth() {
        const PX_M: f64 = 43.5;
        let place = PixelContext { z: 3.0, session_s: 60.0, ..PixelContext::default() };
        let domain = NoiseModel::paper().sigma.domain;
        let constant = SigmaModel::published(Form::Khoshelham, &[0.002], domain);
        let offset = known(&[("disparity-offset", "offset_px", 0.1)]);
        let scale = known(&[("depth-scale", "scale", 1.02)]);
        assert!(log_variance(Noise::OfDisparity, &place, PX_M, &constant, &offset).abs() < 1e-4);
        let by_scale = log_variance(Noise::OfDisparity, &place, PX_M, &constant, &scale);
        assert!((by_scale + 2.0 * 1.02f64.ln()).abs() < 1e-4, "{by_scale}");
        let truth = PX_M / (PX_M / 3.0 - 0.1);
        let px = |z: f64| (0.00151 + 0.00215 * (z - 0.483).powi(2)) / (z * z);
        let expected = 2.0 * (px(truth) / px(3.0)).ln();
        let paper =
            log_variance(Noise::OfDisparity, &place, PX_M, &NoiseModel::paper().sigma, &offset);
        assert!((paper - expected).abs() < 1e-4 && expected > 0.002, "{paper}, not {expected}");
        // Noise of the depth: twice the logarithm of the ratio of sigmas.
        let of_depth = log_variance(Noise::OfDepth, &place, PX_M, &constant, &offset);
        assert!((of_depth - 4.0 * (truth / 3.0).ln()).abs() < 1e-6, "{of_depth}");
        let none = KnownTerms::default();
        let unchanged = log_variance(Noise::OfDisparity, &place, PX_M, &constant, &none);
        assert!(unchanged.abs() < 1e-9, "{unchanged}");
    }
}
