//! What was learnt, put to use on a view: where its pixels lie on every axis, and a model file.

use crate::least_squares::NormalEquations;
use kinoise::camera::{Camera, Rays};
use kinoise::correct::{Conditions, Correction};
use kinoise::diagnose::KnownTerms;
use kinoise::effects::KINECT_BASELINE_M;
use kinoise::error::Result;
use kinoise::model::{Effect, NoiseModel, SigmaModel};
use kinoise::plane::Plane;
use kinoise::scene::TargetFrame;
use kinoise::terms::{PixelContext, Pixels, Term, edge_distances};
use kinoise::view::Sensor;
use nalgebra::Vector3;

use crate::raytraced::question::{ExamView, Predictor};

/// A plane before a camera.
pub struct Stand<'a> {
    pixels: Pixels<'a>,
    plane: Plane,
    board: TargetFrame,
    edge: Vec<f32>,
    conditions: Conditions,
}

impl<'a> Stand<'a> {
    /// `on_target` says for every pixel whether it is the plane's.
    pub fn new(
        pixels: Pixels<'a>,
        plane: Plane,
        on_target: &[bool],
        conditions: Conditions,
    ) -> Self {
        let points = on_target.iter().enumerate().filter(|(_, on)| **on).map(|(i, _)| {
            let (x, y) = pixels.rays.at(i);
            Vector3::new(x, y, 1.0) * plane.depth(x, y)
        });
        let (sum, n) = points.fold((Vector3::zeros(), 0.0), |(s, n), p| (s + p, n + 1.0));
        let board = TargetFrame::on(&plane, sum / f64::max(n, 1.0));
        let edge = edge_distances(on_target, pixels.camera.width);
        Stand { pixels, plane, board, edge, conditions }
    }

    /// Of pixel `i`.
    pub fn place(&self, i: usize) -> PixelContext {
        let mut place = self.pixels.place(i);
        let scale_px_m = self.pixels.scale_px_m;
        place.side = 1.0;
        place.edge = f64::from(self.edge[i]);
        place.at_disparity(scale_px_m * self.plane.inverse_depth(place.x, place.y), scale_px_m);
        place.lean_on(&self.plane, &self.pixels);
        let point = Vector3::new(place.x, place.y, 1.0) * place.z;
        (place.right, place.down) = self.board.place(&point);
        place.session_s = self.conditions.session_s;
        place.temperature_c = self.conditions.temperature_c.unwrap_or(0.0);
        place.ambient = self.conditions.ambient_lux.unwrap_or(0.0);
        place
    }
}

/// The plane through a picture's depth (m, NaN where there is none), with weights that are even in
/// disparity; `None` where there is none.
pub fn plane_of(depth: &[f32], camera: &Camera, rays: &Rays) -> Option<Plane> {
    let mut sums = NormalEquations::default();
    for (i, z) in depth.iter().take(camera.pixels()).enumerate() {
        let z = f64::from(*z);
        if z > 0.0 && z.is_finite() {
            let (x, y) = rays.at(i);
            sums.add(&Vector3::new(x, y, 1.0), 1.0 / z, 1.0);
        }
    }
    sums.solve().map(Plane::new).filter(Plane::is_finite)
}

/// Disparity in px times depth in m.
pub fn scale_px_m(sensor: &Sensor) -> f64 {
    sensor.disparity_px_m().unwrap_or(sensor.camera.fx * KINECT_BASELINE_M)
}

/// A model's biases are taken out; its sigma and its terms of the variance predict the noise.
pub struct ModelPredictor {
    correction: Correction,
    sigma: SigmaModel,
    /// Of the logarithm of the disparity's variance.
    variance: Vec<Term>,
    rays: Rays,
    scale_px_m: f64,
}

/// Of the logarithm of a variance: no prediction calls noise ten times what the model file does, or
/// a tenth. The same for all methods.
pub const MAX_LOG_VARIANCE: f64 = 4.6;

impl ModelPredictor {
    /// Biases that the `given` model has as well are left in the depth: all methods know them.
    pub fn beyond(given: Option<&NoiseModel>, model: &NoiseModel, sensor: &Sensor) -> Result<Self> {
        let is_new = |e: &&Effect| given.is_none_or(|g| !g.effects.contains(e));
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
        let camera = &view.sensor.camera;
        let Some(plane) = plane_of(depth, camera, &self.rays) else {
            return view.sigma_plain.clone();
        };
        let on_target: Vec<bool> = view.depth.iter().map(|z| z.is_finite()).collect();
        let pixels = Pixels::new(camera, &self.rays, self.scale_px_m);
        let stand = Stand::new(pixels, plane, &on_target, view.conditions);
        let has_thermometer = view.conditions.temperature_c.is_some();
        let known = |t: &&Term| has_thermometer || !t.needs().temperature;
        let terms: Vec<&Term> = self.variance.iter().filter(known).collect();
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
