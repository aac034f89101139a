//! A model file applied to a view: removes its biases and predicts its noise.

use kinoise::camera::{Camera, Rays};
use kinoise::correct::Correction;
use kinoise::diagnose::KnownTerms;
use kinoise::error::Result;
use kinoise::model::{Effect, NoiseModel, SigmaModel};
use kinoise::plane::Plane;
use kinoise::scene::TargetFrame;
use kinoise::sensors::KINECT_BASELINE_M;
use kinoise::terms::{Pixels, Term, edge_distances};
use kinoise::view::Sensor;
use nalgebra::Vector3;

use crate::gain::Predictor;
use crate::raytraced::geometry::least_squares;
use crate::raytraced::question::ExamView;

/// Plane through a depth image (m, NaN where there is none), with weights uniform in disparity; `None` where
/// no plane can be fitted.
pub fn plane_of(depth: &[f32], camera: &Camera, rays: &Rays) -> Option<Plane> {
    let seen = depth.iter().take(camera.pixels()).enumerate();
    let rows = seen.filter(|(_, z)| **z > 0.0 && z.is_finite()).map(|(i, z)| {
        let (x, y) = rays.at(i);
        (Vector3::new(x, y, 1.0), 1.0 / f64::from(*z), 1.0)
    });
    least_squares(rows).map(Plane::new).filter(Plane::is_finite)
}

/// Disparity in px times depth in m.
pub fn scale_px_m(sensor: &Sensor) -> f64 {
    sensor.disparity_px_m().unwrap_or(sensor.camera.fx * KINECT_BASELINE_M)
}

/// Removes a model's biases; predicts the noise by its sigma and its variance terms.
pub struct ModelPredictor {
    correction: Correction,
    sigma: SigmaModel,
    /// Terms of the log-variance of the disparity.
    variance: Vec<Term>,
    rays: Rays,
    scale_px_m: f64,
}

/// Limit of the log-variance: predicted noise stays within a factor of ten of the model file's.
const MAX_LOG_VARIANCE: f64 = 4.6;

impl ModelPredictor {
    /// Predictor of `model`. Biases that the `given` model has as well stay in the depth: all
    /// methods know them.
    pub fn beyond(given: &NoiseModel, model: &NoiseModel, sensor: &Sensor) -> Result<Self> {
        let is_new = |e: &&Effect| !given.effects.contains(e);
        let effects = model.effects.iter().filter(is_new).cloned().collect();
        let fresh = NoiseModel { effects, ..model.clone() };
        Ok(ModelPredictor {
            correction: Correction::of(&fresh, sensor)?,
            sigma: model.sigma.clone(),
            variance: KnownTerms::of(model, &sensor.camera).variance,
            rays: sensor.camera.rays(),
            scale_px_m: scale_px_m(sensor),
        })
    }
}

impl Predictor for ModelPredictor {
    fn correct(&self, view: &ExamView, depth: &mut [f32]) -> Result<()> {
        self.correction.apply(depth, &view.conditions)
    }

    fn sigma(&self, view: &ExamView, depth: &[f32]) -> Vec<f32> {
        let (camera, conditions, scale_px_m) =
            (&view.sensor.camera, &view.conditions, self.scale_px_m);
        let Some(plane) = plane_of(depth, camera, &self.rays) else {
            return view.sigma_plain.clone();
        };
        let on_target: Vec<bool> = view.depth.iter().map(|z| z.is_finite()).collect();
        let point = |i: usize| {
            let (x, y) = self.rays.at(i);
            Vector3::new(x, y, 1.0) * plane.depth(x, y)
        };
        let points = (0..depth.len()).filter(|&i| on_target[i]).map(point);
        let (sum, n) = points.fold((Vector3::zeros(), 0.0), |(s, n), p| (s + p, n + 1.0));
        let board = TargetFrame::on(&plane, sum / f64::max(n, 1.0));
        let edge = edge_distances(&on_target, camera.width);
        let pixels = Pixels::new(camera, &self.rays, scale_px_m);
        let known = |t: &&Term| conditions.temperature_c.is_some() || !t.needs().temperature;
        let terms: Vec<&Term> = self.variance.iter().filter(known).collect();
        let theta = plane.theta();
        let of = |i: usize| {
            let mut place = pixels.place(i);
            place.side = 1.0;
            place.edge = f64::from(edge[i]);
            place.at_disparity(scale_px_m * plane.inverse_depth(place.x, place.y), scale_px_m);
            place.lean_on(&plane, &pixels);
            (place.right, place.down) = board.place(&point(i));
            place.session_s = conditions.session_s;
            place.temperature_c = conditions.temperature_c.unwrap_or(0.0);
            place.ambient = conditions.ambient_lux.unwrap_or(0.0);
            let sigma = self.sigma.axial_sigma(place.z, theta);
            place.variance = (sigma * scale_px_m / (place.z * place.z)).powi(2);
            let log: f64 = terms.iter().map(|t| t.value(&place)).sum();
            let log = if log.is_finite() { log } else { 0.0 };
            (sigma * (0.5 * log.clamp(-MAX_LOG_VARIANCE, MAX_LOG_VARIANCE)).exp()) as f32
        };
        (0..depth.len()).map(|i| if on_target[i] { of(i) } else { f32::NAN }).collect()
    }
}
