//! How small an effect this recording could have shown.

use serde_json::{Map, json};

use super::case::Case;
use super::diagnosis::Detectable;
use super::engine::DiagnoseOptions;
use super::layers::Survey;
use super::outcome::Outcome;
use super::power::Gates;
use super::scene::Scene;
use crate::camera::Camera;
use crate::terms::{Basis, Statistic, Term};

/// Effect, parameter, shape, and the parameter of a coefficient.
type Spread = (&'static str, &'static str, Basis, fn(f64) -> f64);

/// The least parameter of each family that would be found with 80 % power.
pub fn detectable(
    survey: &Survey,
    bias: &Outcome,
    variance: &Outcome,
    camera: &Camera,
    options: &DiagnoseOptions,
) -> Vec<Detectable> {
    let (level, seed) = (options.level, options.seed);
    let scenes = [Scene::bias(survey, 1.0, 1.0), Scene::variance(survey, 1.0, 1.0)];
    let mean = Gates {
        scene: &scenes[0],
        outcome: bias,
        rules: survey.bias_rules(camera, Case::MEAN_LEVEL * level),
        beside: None,
        seed,
    };
    let blocks = Gates {
        scene: &scenes[1],
        outcome: variance,
        rules: survey.variance_rules(Case::VARIANCE_LEVEL * level),
        beside: survey.refitted().map(|c| c.basis),
        seed,
    };
    let half = |[low, high]: [f64; 2]| (0.5 * (high - low)).powi(2);
    let (fx, fy) = (camera.fx, camera.fy);
    let bow = half(survey.reach.right);
    let families: Vec<(&'static str, &'static str, Basis, Vec<f64>)> = vec![
        (
            "radial-disparity-bias",
            "k_px",
            Basis::Bowl { disparity_power: 0.0, orders: 1 },
            vec![1.0],
        ),
        ("lens-distortion", "k1", Basis::Lens { fx, fy, orders: 1 }, vec![1.0]),
        ("target-bow", "sagitta_m", Basis::Bow { degree: 2 }, vec![1.0 / bow, 0.0, 0.0]),
        (
            "pixel-locking",
            "amplitude_px",
            Basis::Locking { period_px: 1.0, harmonics: 1 },
            vec![1.0, 0.0],
        ),
        (
            "column-banding",
            "amplitude_px",
            Basis::Banding { period_px: camera.width as f64 / 8.0, harmonics: 1 },
            vec![1.0, 0.0],
        ),
    ];
    let mut all = Vec::new();
    for (effect, name, basis, unit) in families {
        add(&mut all, (effect, name), &mean, Statistic::Bias, basis, unit, |a| a);
    }
    let spreads: Vec<Spread> = vec![
        ("range-exponent", "excess", Basis::RangeExponent { pivot_m: 2.0, orders: 1 }, |a| 0.5 * a),
        ("vignetting", "growth", Basis::Vignetting { orders: 1 }, |a| (0.5 * a).exp() - 1.0),
        ("slope-noise", "sigma_lateral_px", Basis::SlopeNoise { lateral_px: 0.2 }, |a| {
            0.2 * a.sqrt()
        }),
        ("tilt-axis-anisotropy", "ratio", Basis::TiltAxis { tilt_power: 2 }, |a| (0.75 * a).exp()),
    ];
    for (effect, name, basis, to) in spreads {
        add(&mut all, (effect, name), &blocks, Statistic::Variance, basis, vec![1.0], to);
    }
    all
}

#[allow(clippy::too_many_arguments)]
fn add(
    all: &mut Vec<Detectable>,
    (effect, name): (&'static str, &'static str),
    gates: &Gates<'_>,
    statistic: Statistic,
    basis: Basis,
    unit: Vec<f64>,
    to: impl Fn(f64) -> f64,
) {
    let term = Term { statistic, basis, coefficients: unit };
    if let Some(least) = gates.least(&term).map(to).filter(|least| least.is_finite()) {
        let mut minimum = Map::new();
        minimum.insert(name.into(), json!(least));
        all.push(Detectable { effect, minimum });
    }
}
