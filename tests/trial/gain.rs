//! The examination: how much better than the model file does somebody predict views they never saw,
//! against somebody who knows the truth?
//!
//! The score is exact, without drawing noise. A user corrects the depth and fits a plane, so errors
//! that a plane takes up cost nothing; what is left, e, and the true noise, sigma, are scored under
//! the predicted noise s:
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

/// What somebody learnt from a recording, put to use on a view they never saw. Who learnt nothing
/// believes the model file.
pub trait Predictor {
    /// Take the predicted bias out of `depth` (m, NaN where there is none).
    fn correct(&self, _view: &ExamView, _depth: &mut [f32]) -> Result<()> {
        Ok(())
    }

    /// Predicted standard deviation of one frame's noise at `depth`, m.
    fn sigma(&self, view: &ExamView, _depth: &[f32]) -> Vec<f32> {
        view.sigma_plain.clone()
    }
}

/// Who believes the model file.
struct Unaware;

impl Predictor for Unaware {}

/// Who knows the truth: exact bias, exact noise.
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

/// Expected log score beyond that of the model file alone, nats per 1000 pixels, mean over the
/// views. Zero where there is no such view.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// Views like the recording's.
    pub within: f64,
    /// Views outside its distances or tilts.
    pub beyond: f64,
}

/// All methods beside who knows the truth.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Gains {
    pub oracle: Gain,
    pub methods: BTreeMap<String, Gain>,
}

/// Under this name the diagnosis itself stands among the methods.
pub const OUR_METHOD: &str = "kinoise";

/// Weigh the model that was `found` from the set in `folder` (`recording/` beside `model.json`) on
/// fresh views, at least one, with the baselines on the same recording when asked for.
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
/// No depth sensor is surer than this, m: a world without noise has no infinite score.
const MIN_SIGMA_M: f64 = 1e-6;
/// A plane through fewer pixels than this says nothing.
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

/// Mean over the pixels of the target, nats; `None` where there are too few for a plane.
///
/// Where the model file alone leaves an error on the plane, one that it knows of, everybody knows
/// it: errors are counted from `plain`.
fn score(view: &ExamView, predictor: &dyn Predictor) -> Result<Option<f64>> {
    let pixels = pixels(view, predictor)?;
    if pixels.len() < MIN_PIXELS {
        return Ok(None);
    }
    // What the user's plane takes of the error: affine in inverse depth, weighed by the predicted
    // variance; an error of depth by s is one of inverse depth by s / z^2.
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
