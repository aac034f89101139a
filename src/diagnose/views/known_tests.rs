//! Terms read from entries of a model file have the parameters that were written.

use nalgebra::DMatrix;
use serde_json::{Value, json};

use super::*;
use crate::diagnose::finding::parameters::parameters as told;
use crate::effects::Fitted;
use crate::simulate::kinect_v1;
use crate::terms::{Basis, Extent, PixelContext};

fn model(id: &str, parameters: Value) -> NoiseModel {
    let Value::Object(parameters) = parameters else { panic!("an object") };
    let effects = vec![Effect { id: id.into(), parameters, ..Effect::default() }];
    NoiseModel { effects, ..NoiseModel::paper() }
}

fn reach() -> Extent {
    let (disparity, z, unit) = ([10.0, 40.0], [0.8, 3.2], [0.0, 1.0]);
    Extent { disparity, z, theta: unit, light: unit, ambient: unit, ..Extent::default() }
}

/// Round trip: formula of the entry, then the parameters of the term.
#[test]
fn what_is_known_is_told_with_the_same_numbers() {
    let camera = kinect_v1(1).camera;
    let written = [
        ("radial-disparity-bias", "k_px", 0.7),
        ("lens-distortion", "k1", -0.04),
        ("range-not-depth", "share", 1.0),
        ("pixel-locking", "amplitude_px", 0.1),
        ("range-exponent", "excess", 0.6),
        ("slope-noise", "sigma_lateral_px", 0.5),
        ("tilt-axis-anisotropy", "ratio", 1.7),
        ("intensity-dependent-noise", "exponent", 0.8),
        ("ambient-light", "ratio", 0.4),
    ];
    for (id, name, value) in written {
        for form in [json!(value), json!({"value": value, "std_error": 0.1})] {
            let known = KnownTerms::of(&model(id, json!({ name: form })), &camera);
            assert!(known.has(id) && !known.has("vignetting"));
            assert_eq!(known.parameter(id, name), Some(value));
            let terms: Vec<&Term> = known.bias_terms().chain(&known.variance).collect();
            assert_eq!(terms.len(), 1, "{id}");
            let count = terms[0].basis.count();
            assert_eq!(terms[0].coefficients.len(), count, "{id}");
            let none = DMatrix::zeros(count, count);
            let (shape, coefficients) = (&terms[0].basis, &terms[0].coefficients[..]);
            let (covariance, reach) = (&none, &reach());
            let again = told(Some(id), 0.0, &Fitted { shape, coefficients, covariance, reach });
            let found = again[name]["value"].as_f64().unwrap();
            assert!((found / value - 1.0).abs() < 1.3e-3, "{id}: {value} written, {found} told");
        }
    }
}

/// An entry without numbers is simulated and corrected with the card's typical ones.
#[test]
fn what_an_entry_leaves_out_is_typical() {
    let camera = kinect_v1(1).camera;
    let of = |id, parameters| KnownTerms::of(&model(id, parameters), &camera);
    let (without, with) =
        (of("radial-disparity-bias", json!({})), of("radial-disparity-bias", json!({"k_px": 0.5})));
    assert_eq!(without.bias, with.bias);
    assert!(
        without.bias.len() == 1 && without.parameter("radial-disparity-bias", "k_px") == Some(0.5)
    );
    assert_eq!(of("depth-scale", json!({})).law("depth-scale"), Some(1.0 - 1.0 / 1.035));
}

/// The card's parameter: growth of the noise at the corner radius.
#[test]
fn known_vignetting_grows_as_the_catalogue_says() {
    let camera = kinect_v1(1).camera;
    let known = KnownTerms::of(&model("vignetting", json!({"growth": 0.5})), &camera);
    for (radius, factor) in [(0.0, 1.0), (0.5, 1.125), (1.0, 1.5)] {
        let place = PixelContext { radius, ..PixelContext::default() };
        let log: f64 = known.variance[0].value(&place);
        assert!(((0.5 * log).exp() - factor).abs() < 1e-3, "{radius}: {log}");
    }
}

/// An effect without a formula is known by name only; an entry's own shape takes precedence over the formula.
#[test]
fn what_has_no_formula_is_known_by_name() {
    let camera = kinect_v1(1).camera;
    let known = KnownTerms::of(&model("spatial-correlation", json!({"length_px": 5.0})), &camera);
    assert!(known.bias.is_empty() && known.variance.is_empty());
    assert_eq!(known.parameter("spatial-correlation", "length_px"), Some(5.0));
    assert_eq!(known.parameter("spatial-correlation", "width_px"), None);
    let mut shaped = model("vignetting", json!({"growth": 0.5}));
    let term = Term { statistic: Statistic::Bias, basis: Basis::Level, coefficients: vec![3.0] };
    shaped.effects[0].shape = vec![term.clone()];
    let known = KnownTerms::of(&shaped, &camera);
    assert!(known.variance.is_empty() && known.bias[0].0.coefficients == term.coefficients);
}
