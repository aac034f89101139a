//! A model file put to use on a view.

use super::stand::{Stand, plane_of};
use crate::camera::Rays;
use crate::correct::Correction;
use crate::diagnose::KnownTerms;
use crate::effects::KINECT_BASELINE_M;
use crate::error::Result;
use crate::model::{NoiseModel, SigmaModel};
use crate::prove::question::{ExamView, Predictor};
use crate::terms::{Pixels, Term};
use crate::view::Sensor;

/// The biases of a model are taken out, its sigma and its terms of the variance foretell the noise.
pub struct ModelPredictor {
    correction: Correction,
    sigma: SigmaModel,
    /// Of the logarithm of the disparity's variance.
    variance: Vec<Term>,
    rays: Rays,
    scale_px_m: f64,
    parameters: usize,
}

/// Of the logarithm of a variance: no prediction calls noise ten times what the model file does, or
/// a tenth. The same for all methods.
pub(crate) const MAX_LOG_VARIANCE: f64 = 4.6;

impl ModelPredictor {
    /// # Errors
    /// When the model is of another sensor, or holds what the catalogue has not.
    pub fn new(model: &NoiseModel, sensor: &Sensor) -> Result<Self> {
        Self::beyond(None, model, sensor)
    }

    /// Biases that the `given` model has as well are left in the depth: all methods know them.
    ///
    /// # Errors
    /// As [`ModelPredictor::new`].
    pub fn beyond(given: Option<&NoiseModel>, model: &NoiseModel, sensor: &Sensor) -> Result<Self> {
        let is_new = |e: &&crate::model::Effect| given.is_none_or(|g| !g.effects.contains(e));
        let fresh: Vec<_> = model.effects.iter().filter(is_new).cloned().collect();
        let numbers = |e: &crate::model::Effect| match e.shape.len() {
            0 => e.parameters.len(),
            _ => e.shape.iter().map(|t| t.coefficients.len()).sum(),
        };
        let camera = &sensor.camera;
        let parameters = fresh.iter().map(numbers).sum();
        let variance = KnownTerms::of(model, camera).variance;
        let scale_px_m = sensor.disparity_px_m().unwrap_or(camera.fx * KINECT_BASELINE_M);
        let fresh = NoiseModel { effects: fresh, ..model.clone() };
        Ok(ModelPredictor {
            correction: Correction::of(&fresh, sensor)?,
            sigma: model.sigma.clone(),
            variance,
            rays: camera.rays(),
            scale_px_m,
            parameters,
        })
    }

    /// Coefficients and parameters of the entries that are new.
    pub fn parameters(&self) -> usize {
        self.parameters
    }
}

impl Predictor for ModelPredictor {
    fn correct(&self, view: &ExamView, depth: &mut [f32]) -> Result<()> {
        self.correction.apply(depth, &view.conditions)
    }

    fn sigma(&self, view: &ExamView, depth: &[f32]) -> Vec<f32> {
        let camera = &view.sensor.camera;
        let Some(plane) = plane_of(depth, camera, &self.rays) else {
            return view.sigma_plain.clone();
        };
        let on_target: Vec<bool> = view.depth.iter().map(|z| z.is_finite()).collect();
        let pixels = Pixels::new(camera, &self.rays, self.scale_px_m);
        let stand = Stand::new(pixels, plane, &on_target, view.conditions);
        let told = |t: &&Term| view.conditions.temperature_c.is_some() || !t.needs().temperature;
        let terms: Vec<&Term> = self.variance.iter().filter(told).collect();
        let theta = plane.theta();
        let mut row = Vec::new();
        let mut of = |i: usize| {
            let mut place = stand.place(i);
            let sigma = self.sigma.axial_sigma(place.z, theta);
            place.variance = (sigma * self.scale_px_m / (place.z * place.z)).powi(2);
            let log: f64 = terms.iter().map(|t| t.value(&place, &mut row)).sum();
            let log = if log.is_finite() { log } else { 0.0 };
            (sigma * (0.5 * log.clamp(-MAX_LOG_VARIANCE, MAX_LOG_VARIANCE)).exp()) as f32
        };
        (0..depth.len()).map(|i| if on_target[i] { of(i) } else { f32::NAN }).collect()
    }
}
