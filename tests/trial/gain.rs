//! Examination: how much better than the model file does a method predict unseen views, compared with an
//! oracle that knows the truth?
//!
//! The score is exact: no noise is drawn. A user corrects the depth and fits a plane, so errors that a
//! plane absorbs cost nothing. The remaining error e and the true noise, sigma, are scored under the
//! predicted noise s:
//!
//! ```text
//! E[log N(e + noise; 0, s^2)] = -(e^2 + sigma^2) / (2 s^2) - ln s   (+ a constant)
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use kinoise::error::{Error, Result};
use kinoise::model::NoiseModel;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::baselines::{METHODS, Tiles};
use crate::predictor::ModelPredictor;
use crate::raytraced::geometry::least_squares;
use crate::raytraced::question::ExamView;

/// What a method learnt from a recording, applied to an unseen view. By default the model file is believed.
pub trait Predictor {
    /// Removes the predicted bias from `depth` (m, NaN where there is none).
    fn correct(&self, _view: &ExamView, _depth: &mut [f32]) -> Result<()> {
        Ok(())
    }

    /// Predicted standard deviation of one frame's noise at `depth`, m.
    fn sigma(&self, view: &ExamView, _depth: &[f32]) -> Vec<f32> {
        view.sigma_plain.clone()
    }
}

/// Believes the model file.
struct Unaware;

impl Predictor for Unaware {}

/// Knows the truth: exact bias, exact noise.
struct Oracle;

impl Predictor for Oracle {
    fn correct(&self, view: &ExamView, depth: &mut [f32]) -> Result<()> {
        depth.copy_from_slice(&view.plain);
        Ok(())
    }

    fn sigma(&self, view: &ExamView, _depth: &[f32]) -> Vec<f32> {
        view.sigma.clone()
    }
}

/// Expected log score minus that of the model file alone, nats per 1000 pixels, mean over the views. Zero
/// where there are no such views.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// Views within the recording's distances and tilts.
    pub within: f64,
    /// Views outside its distances or tilts.
    pub beyond: f64,
}

/// Gains of the oracle and of all methods.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Gains {
    pub oracle: Gain,
    pub methods: BTreeMap<String, Gain>,
}

/// Name of the diagnosis itself among the methods.
pub const OUR_METHOD: &str = "kinoise";

/// Gains on fresh views, at least one, of the model `found` from the set in `folder` (`recording/` beside
/// `model.json`); with `baselines`, also of the baselines on the same recording.
pub fn examine(
    views: &[ExamView],
    folder: &Path,
    found: &NoiseModel,
    baselines: bool,
) -> Result<Gains> {
    let given = NoiseModel::read(&folder.join("model.json"))?;
    let ours = ModelPredictor::beyond(&given, found, &views[0].sensor)?;
    let mut methods = BTreeMap::from([(OUR_METHOD.to_string(), gain_of(views, &ours)?)]);
    if baselines {
        let tiles = Tiles::of_folder(folder, &given)?;
        for (name, fit) in METHODS {
            methods.insert(name.into(), gain_of(views, &fit(&tiles))?);
        }
    }
    Ok(Gains { oracle: gain_of(views, &Oracle)?, methods })
}

/// Per 1000 pixels.
const PIXELS: f64 = 1000.0;
/// Lower limit of sigma, m, below that of any depth sensor: keeps the score finite in a world without noise.
const MIN_SIGMA_M: f64 = 1e-6;
/// Minimum number of pixels for a plane.
const MIN_PIXELS: usize = 12;

/// Gain of a prediction over the model file alone.
fn gain_of(views: &[ExamView], predictor: &dyn Predictor) -> Result<Gain> {
    let mut sums = [(0.0, 0.0); 2];
    for view in views {
        let Some(plain) = score(view, &Unaware)? else { continue };
        let Some(mine) = score(view, predictor)? else { continue };
        let sum = &mut sums[usize::from(view.beyond)];
        sum.0 += PIXELS * (mine - plain);
        sum.1 += 1.0;
    }
    let [within, beyond] = sums.map(|(sum, n): (f64, f64)| sum / n.max(1.0));
    Ok(Gain { within, beyond })
}

/// One pixel of the target.
struct Scored {
    ray: Vector3<f64>,
    z: f64,
    /// Error of the corrected inverse depth, 1/m.
    error: f64,
    /// True and predicted standard deviation, m.
    sigma: f64,
    predicted: f64,
}

/// Mean score over the pixels of the target, nats; `None` where there are too few for a plane.
///
/// Errors are counted from `plain`: an error that the model file alone leaves on the plane is known to
/// every method.
fn score(view: &ExamView, predictor: &dyn Predictor) -> Result<Option<f64>> {
    let pixels = pixels(view, predictor)?;
    if pixels.len() < MIN_PIXELS {
        return Ok(None);
    }
    // What the user's plane absorbs: affine in inverse depth, weighted by the inverse predicted variance; a
    // depth error s is an inverse-depth error s / z^2.
    let row = |p: &Scored| (p.ray, p.error, (p.z * p.z / p.predicted).powi(2));
    let plane = least_squares(pixels.iter().map(row));
    let Some(q) = plane.filter(|q| q.iter().all(|v| v.is_finite())) else { return Ok(None) };
    let expected = |p: &Scored| {
        let e = (p.error - q.dot(&p.ray)) * p.z * p.z;
        -0.5 * (e * e + p.sigma * p.sigma) / (p.predicted * p.predicted) - p.predicted.ln()
    };
    Ok(Some(pixels.iter().map(expected).sum::<f64>() / pixels.len() as f64))
}

fn pixels(view: &ExamView, predictor: &dyn Predictor) -> Result<Vec<Scored>> {
    let mut depth = view.depth.clone();
    predictor.correct(view, &mut depth)?;
    let predicted = predictor.sigma(view, &depth);
    let rays = view.sensor.camera.rays();
    let mut pixels = Vec::new();
    for i in 0..view.sensor.camera.pixels() {
        let [measured, plain, sigma] = [view.depth[i], view.plain[i], view.sigma[i]].map(f64::from);
        if !(measured > 0.0 && plain > 0.0 && sigma.is_finite()) {
            continue;
        }
        let [corrected, predicted] = [depth[i], predicted[i]].map(f64::from);
        let error = 1.0 / corrected - 1.0 / plain;
        if !(error.is_finite() && predicted.is_finite()) {
            return Err(Error::Argument {
                what: format!("pixel {i}: depth {corrected} m and sigma {predicted} m predicted"),
                remedy: "predict a number wherever there is a measurement",
            });
        }
        let (x, y) = rays.at(i);
        let [sigma, predicted] = [sigma, predicted].map(|s| s.max(MIN_SIGMA_M));
        pixels.push(Scored { ray: Vector3::new(x, y, 1.0), z: plain, error, sigma, predicted });
    }
    Ok(pixels)
}
