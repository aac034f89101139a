//! The expected log score of a prediction, and the two ends of its scale.

use nalgebra::Vector3;

use crate::error::{Error, Result};
use crate::plane::NormalEquations;
use crate::prove::Gain;
use crate::prove::question::{ExamView, Predictor};

/// By what name knowing nothing stands among the methods.
pub const NONE: &str = "none";

/// Who knows the truth: exact bias, exact noise.
#[derive(Debug, Clone, Copy)]
pub struct Oracle;

/// Who believes the model file.
#[derive(Debug, Clone, Copy)]
pub struct Unaware;

impl Predictor for Oracle {
    fn correct(&self, view: &ExamView, depth: &mut [f32]) -> Result<()> {
        depth.copy_from_slice(&view.plain);
        Ok(())
    }

    fn sigma(&self, view: &ExamView, _depth: &[f32]) -> Vec<f32> {
        view.sigma.clone()
    }
}

impl Predictor for Unaware {
    fn correct(&self, _view: &ExamView, _depth: &mut [f32]) -> Result<()> {
        Ok(())
    }

    fn sigma(&self, view: &ExamView, _depth: &[f32]) -> Vec<f32> {
        view.sigma_plain.clone()
    }
}

/// Per 1000 pixels.
const PIXELS: f64 = 1000.0;
/// No depth sensor is surer than this, m: a world without noise has no infinite score.
const MIN_SIGMA_M: f64 = 1e-6;

/// Gain of a prediction over the model file alone.
///
/// # Errors
/// When the prediction does not fit a view, or has a hole where the sensor measured.
pub fn gain_of(views: &[ExamView], predictor: &dyn Predictor) -> Result<Gain> {
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
    x: f64,
    y: f64,
    z: f64,
    /// Error of the corrected inverse depth, 1/m.
    error: f64,
    /// True and predicted standard deviation, m.
    sigma: f64,
    predicted: f64,
}

/// Mean over the pixels of the target, nats; `None` where there are too few for a plane.
///
/// Where the model file alone leaves an error on the plane (one it knows of, or one of the matcher
/// that its simulation has as well), everybody knows it: errors are counted from `plain`.
fn score(view: &ExamView, predictor: &dyn Predictor) -> Result<Option<f64>> {
    let pixels = pixels(view, predictor)?;
    if pixels.len() < 12 {
        return Ok(None);
    }
    let Some(q) = plane(&pixels) else { return Ok(None) };
    let total: f64 = pixels.iter().map(|p| expected(p, &q)).sum();
    Ok(Some(total / pixels.len() as f64))
}

fn pixels(view: &ExamView, predictor: &dyn Predictor) -> Result<Vec<Scored>> {
    let n = view.sensor.camera.pixels();
    let mut depth = view.depth.clone();
    predictor.correct(view, &mut depth)?;
    let predicted = predictor.sigma(view, &depth);
    let sizes = [depth.len(), view.plain.len(), view.sigma.len(), predicted.len()];
    if sizes.iter().any(|&size| size != n) {
        return Err(Error::Argument {
            what: format!("{sizes:?} numbers for {n} pixels"),
            remedy: "predict every pixel of the view's camera",
        });
    }
    let rays = view.sensor.camera.rays();
    let mut pixels = Vec::new();
    for i in 0..n {
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
        pixels.push(Scored { x, y, z: plain, error, sigma, predicted });
    }
    Ok(pixels)
}

/// What the user's plane takes of the error: affine in inverse depth, weighed by the predicted
/// variance.
fn plane(pixels: &[Scored]) -> Option<Vector3<f64>> {
    let mut sums = NormalEquations::default();
    for p in pixels {
        // An error of depth by s is one of inverse depth by s / z^2.
        let weight = (p.z * p.z / p.predicted).powi(2);
        sums.add(&Vector3::new(p.x, p.y, 1.0), p.error, weight);
    }
    sums.solve().filter(|q| q.iter().all(|v| v.is_finite()))
}

fn expected(p: &Scored, q: &Vector3<f64>) -> f64 {
    let e = (p.error - q.dot(&Vector3::new(p.x, p.y, 1.0))) * p.z * p.z;
    -0.5 * (e * e + p.sigma * p.sigma) / (p.predicted * p.predicted) - p.predicted.ln()
}
