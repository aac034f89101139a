//! A model's sensor biases, prepared for removal from depth images.

use std::f64::consts::TAU;

use super::slopes::Noise;
use super::uncertainty::Uncertainty;
use crate::camera::{Camera, Rays};
use crate::effects::{Active, Inverse};
use crate::error::Result;
use crate::model::{self, NoiseModel, SigmaModel};
use crate::sequence::{Moment, Sequence};
use crate::stats::bisect;
use crate::terms::{ANYWHERE, LearntTerm, Needs, Pixels, Statistic, Term};
use crate::view::Sensor;

/// Conditions of a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Conditions {
    /// Time since the session began, s.
    pub session_s: f64,
    /// Degrees Celsius.
    pub temperature_c: Option<f64>,
    /// lx.
    pub ambient_lux: Option<f64>,
}

impl Conditions {
    /// Conditions of a frame of a film.
    pub fn of(moment: &Moment, sequence: &Sequence) -> Self {
        let begin = sequence.moments.first().map_or(0.0, |m| m.stamp);
        let (session_s, temperature_c) = (moment.stamp - begin, sequence.temperature_c);
        Conditions { session_s, temperature_c, ..Conditions::default() }
    }

    /// Whether `term` can be evaluated: a curve over temperature needs a measured temperature.
    pub(super) fn determine(&self, term: &Term) -> bool {
        self.temperature_c.is_some() || !term.needs().temperature
    }
}

/// The biases of a sensor, prepared for removal from its depth images.
#[derive(Debug, Clone)]
pub struct Correction {
    pub(crate) camera: Camera,
    pub(super) rays: Rays,
    /// Disparity in px times depth in m, as in the model.
    pub(crate) scale_px_m: f64,
    /// Stored over true depth, the same for all pixels.
    pub(crate) scale: f64,
    pub(crate) drifts: Vec<Drift>,
    /// Share of the ray's excess length over the depth that is included in stored depths.
    pub(crate) ray_share: f64,
    /// Stored over true depth of each pixel; empty if it is one.
    along_ray: Vec<f32>,
    /// Terms that depend only on the pixel.
    pub(crate) still_terms: Vec<Term>,
    /// Sum of these terms at each pixel, px; empty if there are none.
    still: Vec<f32>,
    /// Amplitude of pixel locking, px; 0 without.
    pub(crate) locking_px: f64,
    /// Shifts that undo it at phases evenly spaced from 0 to 1, px; empty without.
    pub(crate) unlocking: Vec<f64>,
    /// Whether whole columns have offsets that differ from image to image.
    pub(crate) column_steps: bool,
    /// Terms that depend on more than the pixel.
    pub(crate) terms: Vec<LearntTerm>,
    pub(crate) needs: Needs,
    /// Terms that change the logarithm of the noise variance.
    pub(crate) variance: Vec<LearntTerm>,
    pub(super) sigma: SigmaModel,
    pub(crate) noise: Noise,
    pub(super) uncertainty: Uncertainty,
    ignored: Vec<String>,
    unpredicted: Vec<String>,
    remarks: Vec<String>,
}

/// Warm-up: depth drifts by `relative` with a time constant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drift {
    pub relative: f64,
    pub time_constant_s: f64,
}

impl Correction {
    /// Prepares the biases of `model` for `sensor`.
    /// Fails if the model is of another resolution or contains effects that the catalogue does not have.
    pub fn of(model: &NoiseModel, sensor: &Sensor) -> Result<Self> {
        let of_model = model.described_sensor()?;
        model.refuse_other_size(sensor)?;
        let camera = sensor.camera.clone();
        // Terms are in px of the model's disparity.
        let scale_px_m = of_model.as_ref().unwrap_or(sensor).scale_px_m();
        let mut correction = Correction {
            rays: camera.rays(),
            scale_px_m,
            scale: 1.0,
            drifts: Vec::new(),
            ray_share: 0.0,
            along_ray: Vec::new(),
            still_terms: Vec::new(),
            still: Vec::new(),
            locking_px: 0.0,
            unlocking: Vec::new(),
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

    /// Whether there is nothing to remove.
    pub fn is_identity(&self) -> bool {
        self.scale == 1.0
            && self.drifts.is_empty()
            && self.along_ray.is_empty()
            && self.still.is_empty()
            && self.unlocking.is_empty()
            && !self.column_steps
            && self.terms.is_empty()
    }

    /// Ids of the model's entries that are not, or not entirely, biases of the sensor.
    pub fn ignored(&self) -> &[String] {
        &self.ignored
    }

    /// Ids of the entries with a part that is no predictable bias or noise of a pixel.
    pub fn unpredicted(&self) -> &[String] {
        &self.unpredicted
    }

    /// Range of disparities at which all terms that scale with the disparity were learnt, px.
    pub(super) fn learnt_px(&self) -> Option<[f64; 2]> {
        let grows = |(t, _): &&LearntTerm| t.basis.still_power().is_some();
        let ranges = self.terms.iter().filter(grows).map(|(_, learnt)| *learnt);
        let both = ranges.reduce(|a, b| [a[0].max(b[0]), a[1].min(b[1])])?;
        (both != ANYWHERE).then_some(both)
    }

    /// Remark on frames without a temperature, if a bias needs one.
    pub(crate) fn remark_without_temperature(&self, place: &str) -> Option<String> {
        self.needs.temperature.then(|| {
            format!(
                "{place}: the model's bias over temperature stays in, because the temperature is unknown; a view.json gives it as temperature_c, a bag in a topic of sensor_msgs/Temperature"
            )
        })
    }

    /// Remarks on this combination of model and sensor, and on what sigma lacks, also for want of a
    /// temperature.
    pub(super) fn remarks_on_sigma(&self, conditions: &Conditions) -> Vec<String> {
        let mut remarks = self.remarks.clone();
        remarks.extend(self.unpredicted.iter().map(|id| format!("sigma lacks the model's {id}")));
        let of_temperature = |(t, _): &LearntTerm| !conditions.determine(t);
        if self.variance.iter().any(of_temperature) {
            remarks.push(
                "sigma lacks what the model says of the temperature, which is unknown".into(),
            );
        }
        remarks
    }

    /// Remarks on this combination of model and sensor.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Stored over true depth, the same for all pixels of a frame.
    pub(super) fn factor(&self, conditions: &Conditions) -> f64 {
        let drift =
            |d: &Drift| 1.0 - d.relative * (-conditions.session_s / d.time_constant_s).exp_m1();
        self.scale * self.drifts.iter().map(drift).product::<f64>()
    }

    /// Disparity without the driver's errors, the pixel's own bias and pixel locking, px.
    pub(super) fn disparity(&self, i: usize, z: f32, factor: f64) -> f64 {
        let along = self.along_ray.get(i).copied().map_or(1.0, f64::from);
        let still = self.still.get(i).copied().map_or(0.0, f64::from);
        let d = self.scale_px_m * factor * along / f64::from(z) - still;
        if self.unlocking.is_empty() { d } else { d + interpolated(&self.unlocking, d) }
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

    /// Adds an entry given by the catalogue's formula.
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
                let phases = (0..=NODES).map(|k| k as f64 / NODES as f64);
                self.locking_px = amplitude_px;
                self.unlocking = phases.map(|d| unlocked(d, amplitude_px) - d).collect();
            }
            None => {
                let term = active.effect.term(&active.settings, &self.camera);
                match term.filter(is_predictable_variance) {
                    Some(term) => self.variance.push((term, ANYWHERE)),
                    None => self.unpredicted.push(entry.id.clone()),
                }
                self.ignored.push(entry.id.clone());
            }
        }
        Ok(())
    }

    /// 1 + share (ray length over depth - 1) of each pixel.
    fn ray_over_depth(&self, share: f64) -> Vec<f32> {
        let factor = |i: usize| {
            let (x, y) = self.rays.at(i);
            (1.0 + share * ((1.0 + x * x + y * y).sqrt() - 1.0)) as f32
        };
        (0..self.camera.pixels()).map(factor).collect()
    }

    /// Sums the terms that depend only on the pixel once for all images.
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

/// Nodes for linear interpolation, a thousandth of a pixel apart. For an amplitude of a tenth of a pixel the
/// inverse has a curvature of a few px per px^2, and the error is 1e-6 px.
const NODES: usize = 1024;

/// Value at the phase of a disparity.
fn interpolated(nodes: &[f64], disparity: f64) -> f64 {
    let last = nodes.len() - 1;
    let place = disparity.rem_euclid(1.0) * last as f64;
    let k = (place as usize).min(last - 1);
    let t = place - k as f64;
    nodes[k] * (1.0 - t) + nodes[k + 1] * t
}

/// The disparity that locks to this one, px. Above an amplitude of 1/(2 pi) px there are several; this is one.
fn unlocked(locked: f64, amplitude_px: f64) -> f64 {
    let bracket = [locked - amplitude_px, locked + amplitude_px];
    let [low, high] = bisect(bracket, |d| d - amplitude_px * (TAU * d).sin() < locked);
    0.5 * (low + high)
}

/// Whether a term changes the noise predictably from the image alone, without the board or its light.
fn is_predictable_variance(term: &Term) -> bool {
    let needs = term.needs();
    let own = term.belongs_to_sensor() && !needs.board && !needs.light;
    term.statistic == Statistic::Variance && own
}
