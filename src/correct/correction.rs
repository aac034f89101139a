//! What a model says about a sensor's biases, ready to be taken out of its depth.

use super::locking::Locking;
use super::slopes::Noise;
use super::uncertainty::Uncertainty;
use crate::camera::{Camera, Rays};
use crate::effects::{Active, Inverse};
use crate::error::Result;
use crate::model::{self, NoiseModel, SigmaModel};
use crate::sensors::KINECT_BASELINE_M;
use crate::terms::{Needs, Pixels, Statistic, Term};
use crate::view::Sensor;

/// What is known of a frame beside its depths.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Conditions {
    /// Since the session began, s.
    pub session_s: f64,
    /// Degrees Celsius.
    pub temperature_c: Option<f64>,
    /// lx.
    pub ambient_lux: Option<f64>,
}

impl Conditions {
    /// A curve over the temperature needs a thermometer.
    pub(super) fn determine(&self, term: &Term) -> bool {
        self.temperature_c.is_some() || !term.needs().temperature
    }
}

/// A term of the model with the disparities at which it was learnt, px.
pub(crate) type LearntTerm = (Term, [f64; 2]);

/// The biases of a sensor, ready to be taken out of its depth images.
#[derive(Debug, Clone)]
pub struct Correction {
    pub(crate) camera: Camera,
    pub(super) rays: Rays,
    /// Disparity in px times depth in m, as the model counts it.
    pub(crate) scale_px_m: f64,
    /// Stored depth over true depth, the same everywhere.
    pub(crate) scale: f64,
    pub(crate) drifts: Vec<Drift>,
    /// Share of the ray's excess over the depth that is stored.
    pub(crate) ray_share: f64,
    /// Stored depth over true depth of each pixel; empty where it is one.
    along_ray: Vec<f32>,
    /// What depends on the pixel alone.
    pub(crate) still_terms: Vec<Term>,
    /// Their sum at each pixel, px; empty where there are none.
    still: Vec<f32>,
    pub(crate) locking: Option<Locking>,
    /// Do whole columns step, differently in every image?
    pub(crate) column_steps: bool,
    /// What depends on more than the pixel.
    pub(crate) terms: Vec<LearntTerm>,
    pub(crate) needs: Needs,
    /// What changes the logarithm of the noise's variance.
    pub(crate) variance: Vec<LearntTerm>,
    pub(super) sigma: SigmaModel,
    pub(crate) noise: Noise,
    pub(super) uncertainty: Uncertainty,
    ignored: Vec<String>,
    unpredicted: Vec<String>,
    remarks: Vec<String>,
}

/// Of shapes that do not say where they were learnt.
const ANYWHERE: [f64; 2] = [0.0, f64::INFINITY];

/// Warm-up: depth drifts by `relative` with a time constant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drift {
    pub relative: f64,
    pub time_constant_s: f64,
}

impl Correction {
    /// What `model` says about `sensor`.
    /// An error when the model is of a sensor of another resolution, or holds what the catalogue has not.
    pub fn of(model: &NoiseModel, sensor: &Sensor) -> Result<Self> {
        let of_model = model.described_sensor()?;
        model.refuse_other_size(sensor)?;
        let camera = sensor.camera.clone();
        // Terms are in px of the disparity that the model counts.
        let scale_px_m = of_model
            .as_ref()
            .and_then(Sensor::disparity_px_m)
            .or(sensor.disparity_px_m())
            .unwrap_or(camera.fx * KINECT_BASELINE_M);
        let mut correction = Correction {
            rays: camera.rays(),
            scale_px_m,
            scale: 1.0,
            drifts: Vec::new(),
            ray_share: 0.0,
            along_ray: Vec::new(),
            still_terms: Vec::new(),
            still: Vec::new(),
            locking: None,
            column_steps: false,
            terms: Vec::new(),
            needs: Needs::default(),
            uncertainty: Uncertainty::default(),
            variance: Vec::new(),
            noise: Noise::of(&model.sigma, scale_px_m),
            sigma: model.sigma.clone(),
            ignored: Vec::new(),
            unpredicted: Vec::new(),
            remarks: model.differences(sensor),
            camera,
        };
        for entry in &model.effects {
            correction.add(entry)?;
        }
        correction.settle();
        Ok(correction)
    }

    /// Is there nothing to take out?
    pub fn is_identity(&self) -> bool {
        self.scale == 1.0
            && self.drifts.is_empty()
            && self.along_ray.is_empty()
            && self.still.is_empty()
            && self.locking.is_none()
            && !self.column_steps
            && self.terms.is_empty()
    }

    /// Ids of the model's entries, or parts of them, that are no bias of the sensor.
    pub fn ignored(&self) -> &[String] {
        &self.ignored
    }

    /// Ids of the entries, or parts of them, that neither the bias nor the noise of a pixel shows.
    pub fn unpredicted(&self) -> &[String] {
        &self.unpredicted
    }

    /// Disparities at which all that grows with the disparity was learnt, px.
    pub(super) fn learnt_px(&self) -> Option<[f64; 2]> {
        let grows = |(t, _): &&LearntTerm| t.basis.still_power().is_some();
        let ranges = self.terms.iter().filter(grows).map(|(_, learnt)| *learnt);
        let both = ranges.reduce(|a, b| [a[0].max(b[0]), a[1].min(b[1])])?;
        (both != ANYWHERE).then_some(both)
    }

    /// What is odd about model and sensor together, in sentences.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Stored depth over true depth, the same everywhere in a frame.
    pub(super) fn factor(&self, conditions: &Conditions) -> f64 {
        let drift =
            |d: &Drift| 1.0 - d.relative * (-conditions.session_s / d.time_constant_s).exp_m1();
        self.scale * self.drifts.iter().map(drift).product::<f64>()
    }

    /// Disparity without the driver's errors and those of the pixel and of its phase, px.
    pub(super) fn disparity(&self, i: usize, z: f32, factor: f64) -> f64 {
        let along = self.along_ray.get(i).copied().map_or(1.0, f64::from);
        let still = self.still.get(i).copied().map_or(0.0, f64::from);
        let d = self.scale_px_m * factor * along / f64::from(z) - still;
        self.locking.as_ref().map_or(d, |locking| locking.unlock(d))
    }

    fn add(&mut self, entry: &model::Effect) -> Result<()> {
        if entry.shape.is_empty() {
            return self.add_formula(entry);
        }
        let usable = |t: &&Term| t.is_correctable();
        let learnt = entry.learnt_px.unwrap_or(ANYWHERE);
        self.terms.extend(entry.shape.iter().filter(usable).map(|t| (t.clone(), learnt)));
        let variance = entry.shape.iter().filter(|&t| is_predictable_variance(t));
        self.variance.extend(variance.map(|t| (t.clone(), learnt)));
        self.uncertainty.add(entry, learnt, usable);
        if !entry.shape.iter().all(|t| usable(&t)) {
            self.ignored.push(entry.id.clone());
        }
        if !entry.shape.iter().all(|t| usable(&t) || is_predictable_variance(t)) {
            self.unpredicted.push(entry.id.clone());
        }
        Ok(())
    }

    /// An entry that the catalogue's formula stands for.
    fn add_formula(&mut self, entry: &model::Effect) -> Result<()> {
        let active = Active::from_model(entry)?;
        if active.is_identity() {
            return Ok(());
        }
        self.uncertainty.add_law(entry);
        match active.effect.inverse(&active.settings, &self.camera) {
            Some(Inverse::Term(term)) => self.terms.push((term, ANYWHERE)),
            Some(Inverse::Scale(scale)) => self.scale *= scale,
            Some(Inverse::Drift { relative, time_constant_s }) => {
                self.drifts.push(Drift { relative, time_constant_s });
            }
            Some(Inverse::AlongRay { share }) => {
                self.ray_share = share;
                self.along_ray = self.ray_over_depth(share);
            }
            Some(Inverse::ColumnSteps) => self.column_steps = true,
            Some(Inverse::Locking { amplitude_px }) => {
                self.locking = Some(Locking::new(amplitude_px));
            }
            None => {
                let card = active.effect.card();
                let term =
                    active.effect.term(&|name| active.settings.named(card, name), &self.camera);
                match term.filter(is_predictable_variance) {
                    Some(term) => self.variance.push((term, ANYWHERE)),
                    None => self.unpredicted.push(entry.id.clone()),
                }
                self.ignored.push(entry.id.clone());
            }
        }
        Ok(())
    }

    /// 1 + share (ray length over depth - 1), of each pixel.
    fn ray_over_depth(&self, share: f64) -> Vec<f32> {
        let factor = |i: usize| {
            let (x, y) = self.rays.at(i);
            (1.0 + share * ((1.0 + x * x + y * y).sqrt() - 1.0)) as f32
        };
        (0..self.camera.pixels()).map(factor).collect()
    }

    /// Terms that depend on the pixel alone are added up once for all images.
    fn settle(&mut self) {
        let (still, other): (Vec<_>, Vec<_>) =
            self.terms.drain(..).partition(|(t, _)| t.needs() == Needs::default());
        self.terms = other;
        self.still_terms = still.into_iter().map(|(t, _)| t).collect();
        self.needs = Needs::of(self.terms.iter().map(|(t, _)| t));
        if !self.still_terms.is_empty() {
            let pixels = Pixels::new(&self.camera, &self.rays, self.scale_px_m);
            let sum = |i: usize| {
                let place = pixels.place(i);
                let all = self.still_terms.iter();
                all.map(|t| t.value(&place)).sum::<f64>() as f32
            };
            self.still = (0..self.camera.pixels()).map(sum).collect();
        }
    }
}

/// A change of the noise that follows from the picture, and from nothing of a board or its light.
fn is_predictable_variance(term: &Term) -> bool {
    let needs = term.needs();
    let own = term.belongs_to_sensor() && !needs.board && !needs.light;
    term.statistic == Statistic::Variance && own
}
