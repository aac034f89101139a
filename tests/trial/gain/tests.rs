//! Oracles: hand calculations, and predictors that know the truth.

use super::*;
use crate::raytraced::question::Predictor;
use kinoise::camera::Camera;
use kinoise::correct::Conditions;
use kinoise::frame::DepthCode;
use kinoise::plane::Plane;
use kinoise::terms::corner_radius;
use kinoise::view::Sensor;

pub(crate) fn sensor() -> Sensor {
    let camera =
        Camera { width: 80, height: 60, fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5, distortion: None };
    let code = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
    let name = "a depth camera".into();
    Sensor { name, serial: None, mode: None, camera, baseline_m: Some(0.15), code }
}

/// Of one pixel: column, row, radius (0 to 1), disparity (px).
pub(crate) type Spot = [f64; 4];

/// A plane that fills the picture. `bias` (px) is added to its disparity, `spread` multiplies a sigma
/// of a tenth of a pixel of disparity.
pub(crate) fn view(
    plane: &Plane,
    bias: &dyn Fn(Spot) -> f64,
    spread: &dyn Fn(Spot) -> f64,
) -> ExamView {
    let sensor = sensor();
    let (camera, scale) = (sensor.camera.clone(), sensor.disparity_px_m().unwrap());
    let corner = corner_radius(&camera);
    let mut view = ExamView {
        sensor,
        beyond: false,
        theta: plane.theta(),
        azimuth: plane.azimuth(),
        conditions: Conditions::default(),
        depth: Vec::new(),
        plain: Vec::new(),
        sigma: Vec::new(),
        sigma_plain: Vec::new(),
    };
    for i in 0..camera.pixels() {
        let (u, v) = ((i % camera.width) as f64, (i / camera.width) as f64);
        let (x, y) = camera.ray(u, v);
        let d = scale * plane.inverse_depth(x, y);
        let spot = [u, v, (u - camera.cx).hypot(v - camera.cy) / corner, d];
        let sigma = SIGMA_PX * scale / (d * d);
        view.depth.push((scale / (d + bias(spot))) as f32);
        view.plain.push((scale / d) as f32);
        view.sigma.push((sigma * spread(spot)) as f32);
        view.sigma_plain.push(sigma as f32);
    }
    view
}

pub(crate) const SIGMA_PX: f64 = 0.1;

fn frontal(bias: &dyn Fn(Spot) -> f64, spread: &dyn Fn(Spot) -> f64) -> ExamView {
    view(&Plane::tilted(2.0, 0.0, 0.0), bias, spread)
}

fn one(_: Spot) -> f64 {
    1.0
}

fn none(_: Spot) -> f64 {
    0.0
}

fn oracle(view: ExamView) -> f64 {
    gain_of(&[view], &Oracle).unwrap().within
}

/// A noise q times the model's: q^2 / 2 - 1/2 - ln q nats a pixel.
#[test]
fn a_constant_ratio_gains_what_it_must() {
    for q in [0.6, 1.0, 1.3, 2.0f64] {
        let gain = oracle(frontal(&none, &|_| q));
        let must = 1000.0 * (0.5 * q * q - 0.5 - q.ln());
        assert!((gain - must).abs() < 0.01, "{q}: {gain} {must}");
    }
}

/// k r^2 on a frontal view: a plane takes its mean, and the mean square of the rest, over the
/// variance, is twice the gain.
#[test]
fn a_radial_bias_gains_what_it_must() {
    let k = 0.3;
    let gain = oracle(frontal(&|[_, _, r, _]| k * r * r, &one));
    let c = sensor().camera;
    let corner = corner_radius(&c);
    // Of r^2 = (x^2 + y^2) / corner^2 with x of n evenly spaced whole numbers: the variance of the
    // square of each is (n^2 - 1)(n^2 - 4) / 180.
    let spread = |n: f64| (n * n - 1.0) * (n * n - 4.0) / 180.0;
    let variance = (spread(c.width as f64) + spread(c.height as f64)) / corner.powi(4);
    let must = 1000.0 * 0.5 * variance * (k / SIGMA_PX).powi(2);
    // The error is scored in metres at the depth, and the disparity changes by a percent.
    assert!((gain / must - 1.0).abs() < 0.01, "{gain} {must}");
}

/// Affine in disparity: nobody can see it, and nobody is paid for it.
#[test]
fn what_a_plane_absorbs_gains_nothing() {
    let tilted = Plane::tilted(1.7, 0.6, 0.8);
    let affine = |[u, v, _, _]: Spot| 0.4 + 0.01 * u - 0.02 * v;
    let scale = |[_, _, _, d]: Spot| 0.02 * d;
    for bias in [&affine as &dyn Fn(Spot) -> f64, &scale] {
        let gain = oracle(view(&tilted, bias, &one));
        assert!(gain.abs() < 0.01, "{gain}");
    }
}

/// What was written into the view, as a model file says it.
struct Knows;

impl Predictor for Knows {
    fn correct(&self, view: &ExamView, depth: &mut [f32]) -> kinoise::error::Result<()> {
        let scale = view.sensor.disparity_px_m().unwrap();
        let corner = corner_radius(&view.sensor.camera);
        let c = &view.sensor.camera;
        for (i, z) in depth.iter_mut().enumerate() {
            let (u, v) = ((i % c.width) as f64, (i / c.width) as f64);
            let r = (u - c.cx).hypot(v - c.cy) / corner;
            *z = (scale / (scale / f64::from(*z) - 0.3 * r * r)) as f32;
        }
        Ok(())
    }

    fn sigma(&self, view: &ExamView, _: &[f32]) -> Vec<f32> {
        view.sigma_plain.iter().map(|s| 1.5 * s).collect()
    }
}

fn bowl([_, _, r, _]: Spot) -> f64 {
    0.3 * r * r
}

#[test]
fn the_truth_reaches_the_oracle_and_nothing_beats_it() {
    let plane = Plane::tilted(1.5, 0.5, 1.0);
    let views = [view(&plane, &bowl, &|_| 1.5)];
    let (oracle, knows) = (gain_of(&views, &Oracle).unwrap(), gain_of(&views, &Knows).unwrap());
    assert!(oracle.within > 100.0);
    assert!((knows.within / oracle.within - 1.0).abs() < 1e-4, "{knows:?} {oracle:?}");
    assert_eq!(gain_of(&views, &Unaware).unwrap(), crate::Gain::default());
    // Wrong corrections cost: the bias taken out of a view that has none.
    let clean = [view(&plane, &none, &one)];
    assert!(gain_of(&clean, &Knows).unwrap().within < -100.0);
}

/// Views outside are counted apart; holes and what is off the target not at all.
#[test]
fn views_are_counted_apart_and_holes_not_at_all() {
    let mut far = frontal(&none, &|_| 2.0);
    far.beyond = true;
    for i in (0..far.depth.len()).step_by(3) {
        far.depth[i] = f32::NAN;
    }
    let views = [frontal(&none, &one), frontal(&none, &|_| 2.0), far];
    let gain = gain_of(&views, &Oracle).unwrap();
    let must = 1000.0 * (1.5 - 2f64.ln());
    assert!((gain.within - 0.5 * must).abs() < 0.01 && (gain.beyond - must).abs() < 0.01);
    assert_eq!(gain_of(&[], &Oracle).unwrap(), crate::Gain::default());
}

/// A number that is missing is an error, not a free pass.
#[test]
fn a_hole_in_a_prediction_is_refused() {
    struct Silent;
    impl Predictor for Silent {
        fn correct(&self, _: &ExamView, depth: &mut [f32]) -> kinoise::error::Result<()> {
            depth[7] = f32::NAN;
            Ok(())
        }
        fn sigma(&self, view: &ExamView, _: &[f32]) -> Vec<f32> {
            view.sigma_plain.clone()
        }
    }
    assert!(gain_of(&[frontal(&none, &one)], &Silent).is_err());
}

mod model_file {
    use super::*;
    use kinoise::model::{Domain, Effect, FitSummary, Form, Provenance, SigmaModel};
    use kinoise::terms::{Basis, Statistic, Term};
    use kinoise::view::RecordingFile;

    fn model(effects: Vec<Effect>) -> NoiseModel {
        let domain = Domain { z_m: [0.3, 9.0], theta_rad: [0.0, 1.3] };
        // A tenth of a pixel: Khoshelham's c z^2.
        let c = SIGMA_PX / sensor().disparity_px_m().unwrap();
        NoiseModel {
            sensor: Some(RecordingFile::of(&sensor())),
            sigma: SigmaModel::published(Form::Khoshelham, &[c], domain),
            effects,
            fit: FitSummary::default(),
            provenance: Provenance::default(),
        }
    }

    fn shape(statistic: Statistic, basis: Basis, coefficients: Vec<f64>) -> Effect {
        let shape = vec![Term { statistic, basis, coefficients }];
        Effect { id: "unexplained".into(), shape, ..Effect::default() }
    }

    fn bowl_and_rim() -> Vec<Effect> {
        let bowl = Basis::Bowl { disparity_power: 0.0, orders: 1 };
        let rim = Basis::Vignetting { orders: 1 };
        vec![shape(Statistic::Bias, bowl, vec![0.1]), shape(Statistic::Variance, rim, vec![1.2])]
    }

    fn bowl([_, _, r, _]: Spot) -> f64 {
        0.1 * r * r
    }

    fn rim([_, _, r, _]: Spot) -> f64 {
        (0.6 * r * r).exp()
    }

    #[test]
    fn a_model_of_the_truth_reaches_the_oracle() {
        let views: Vec<ExamView> = [(0.6, 0.0), (0.8, 0.5), (1.2, 0.2)]
            .into_iter()
            .map(|(z, theta)| view(&Plane::tilted(z, theta, 0.7), &bowl, &rim))
            .collect();
        let oracle = gain_of(&views, &Oracle).unwrap().within;
        let predictor = ModelPredictor::new(&model(bowl_and_rim()), &sensor()).unwrap();
        let gain = gain_of(&views, &predictor).unwrap().within;
        assert_eq!(predictor.parameters(), 2);
        assert!((gain / oracle - 1.0).abs() < 2e-3, "{gain} {oracle}");
        // The model file alone is what "none" stands for, but for the sigma of a plane that the
        // bias has moved by a percent of its depth.
        let plain = ModelPredictor::new(&model(Vec::new()), &sensor()).unwrap();
        let nothing = gain_of(&views, &plain).unwrap().within;
        assert!(nothing.abs() < 0.05 * oracle, "{nothing} {oracle}");
    }

    /// A bias that the model file had from the start is in `plain` too, and nobody's merit.
    #[test]
    fn what_was_given_is_not_taken_out_again() {
        let given = model(vec![bowl_and_rim().remove(0)]);
        let plane = Plane::tilted(0.8, 0.4, 0.7);
        let mut seen = view(&plane, &bowl, &rim);
        seen.plain = seen.depth.clone();
        let found = model(bowl_and_rim());
        let predictor = ModelPredictor::beyond(Some(&given), &found, &sensor()).unwrap();
        assert_eq!(predictor.parameters(), 1);
        let views = [seen];
        let ratio =
            gain_of(&views, &predictor).unwrap().within / gain_of(&views, &Oracle).unwrap().within;
        assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
    }
}
