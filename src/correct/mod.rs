//! Taking a model's biases out of depth again: the effects of the light's path, backwards.
//!
//! ```text
//! word -> z -driver-> disparity -still, locking, terms-> disparity -> z -> word
//! ```
//! A [`Correction`] does one depth image; [`correct_recording`] does all that lie in a folder.

mod again;
mod describe;
mod entries;
mod files;
mod locking;
mod recording;
mod slopes;
mod words;

pub use recording::{Corrected, correct_recording};

use rayon::prelude::*;

use crate::camera::{Camera, Rays};
use crate::error::{Error, Result};
use crate::model::NoiseModel;
use crate::plane::Plane;
use crate::terms::{Needs, PixelContext, Pixels, Term};
use crate::view::Sensor;
use locking::Locking;
use slopes::{Noise, Slopes};

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
    fn tell(&self, term: &Term) -> bool {
        self.temperature_c.is_some() || !term.needs().temperature
    }
}

/// The biases of a sensor, ready to be taken out of its depth images.
#[derive(Debug, Clone)]
pub struct Correction {
    camera: Camera,
    rays: Rays,
    /// Disparity in px times depth in m, as the model counts it.
    scale_px_m: f64,
    /// Stored depth over true depth, the same everywhere.
    scale: f64,
    drifts: Vec<Drift>,
    /// Stored depth over true depth of each pixel; empty where it is one.
    along_ray: Vec<f32>,
    /// Error of the disparity of each pixel whatever it sees, px; empty where there is none.
    still: Vec<f32>,
    locking: Option<Locking>,
    /// What depends on more than the pixel.
    terms: Vec<Term>,
    needs: Needs,
    noise: Noise,
    ignored: Vec<String>,
    remarks: Vec<String>,
}

/// Warm-up: depth drifts by `relative` with a time constant.
#[derive(Debug, Clone, Copy)]
struct Drift {
    relative: f64,
    time_constant_s: f64,
}

/// The error of a term is taken at the corrected disparity: substituted until it changes by less, px.
/// What is left is less again by the term's steepness, a hundredth for terms of a few tenths of a px
/// over tens of px: two rounds, and a hundred thousandth of a pixel.
const SETTLED_PX: f64 = 1e-3;
const MAX_ROUNDS: usize = 8;

impl Correction {
    /// What `model` says about `sensor`.
    ///
    /// # Errors
    /// When the model is of a sensor of another resolution, or holds what the catalogue has not.
    pub fn of(model: &NoiseModel, sensor: &Sensor) -> Result<Self> {
        entries::correction(model, sensor)
    }

    /// Is there nothing to take out?
    pub fn is_identity(&self) -> bool {
        self.scale == 1.0
            && self.drifts.is_empty()
            && self.along_ray.is_empty()
            && self.still.is_empty()
            && self.locking.is_none()
            && self.terms.is_empty()
    }

    /// Ids of the model's entries, or parts of them, that are no bias of the sensor.
    pub fn ignored(&self) -> &[String] {
        &self.ignored
    }

    /// What is odd about model and sensor together, in words.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Take the biases out of one depth image, m; NaN where there is no measurement stays NaN. A
    /// depth becomes infinite where the errors leave no disparity.
    ///
    /// # Errors
    /// When the image is not of the sensor's size.
    pub fn apply(&self, depth_m: &mut [f32], conditions: &Conditions) -> Result<()> {
        if depth_m.len() != self.camera.pixels() {
            return Err(Error::Argument {
                what: format!("{} depths for {} pixels", depth_m.len(), self.camera.pixels()),
                remedy: "give the whole image of the model's sensor, row by row",
            });
        }
        if self.is_identity() {
            return Ok(());
        }
        let factor = self.scale * self.drifts.iter().map(|d| d.factor(conditions)).product::<f64>();
        let slopes = self.needs.slope.then(|| self.slopes(depth_m, factor));
        let pixels = Pixels::new(&self.camera, &self.rays, self.scale_px_m);
        let terms = self.terms.iter().filter(|t| conditions.tell(t)).collect();
        let known =
            Known { conditions, slopes: slopes.as_ref(), pixels, terms, tilt: self.needs.tilt };
        let width = self.camera.width;
        depth_m.par_chunks_mut(width).enumerate().for_each(|(row, line)| {
            let mut scratch = Vec::new();
            for (u, z) in line.iter_mut().enumerate() {
                if *z > 0.0 {
                    let i = row * width + u;
                    let measured = self.disparity(i, *z, factor);
                    let true_d = self.solve(i, measured, &known, &mut scratch);
                    let scaled = self.scale_px_m / true_d;
                    *z = if true_d > 0.0 { scaled as f32 } else { f32::INFINITY };
                }
            }
        });
        Ok(())
    }

    /// Disparity without the driver's errors and those of the pixel and of its phase, px.
    fn disparity(&self, i: usize, z: f32, factor: f64) -> f64 {
        let along = self.along_ray.get(i).copied().map_or(1.0, f64::from);
        let still = self.still.get(i).copied().map_or(0.0, f64::from);
        let d = self.scale_px_m * factor * along / f64::from(z) - still;
        self.locking.as_ref().map_or(d, |locking| locking.unlock(d))
    }

    /// The disparity that the terms turn into `measured`, px.
    fn solve(&self, i: usize, measured: f64, known: &Known<'_>, scratch: &mut Vec<f64>) -> f64 {
        if self.terms.is_empty() || measured <= 0.0 {
            return measured;
        }
        let mut place = known.place(i);
        let mut d = measured;
        for _ in 0..MAX_ROUNDS {
            known.stand(&mut place, i, d);
            let bias: f64 = known.terms.iter().map(|t| t.value(&place, scratch)).sum();
            let next = measured - bias;
            if !next.is_finite() {
                return measured;
            }
            let change = (next - d).abs();
            d = next;
            if !self.needs.depth || change < SETTLED_PX || d <= 0.0 {
                return d;
            }
        }
        d
    }

    fn slopes(&self, depth_m: &[f32], factor: f64) -> Slopes {
        let disparity = |i: usize| match depth_m[i] {
            z if z > 0.0 => self.disparity(i, z, factor),
            _ => f64::NAN,
        };
        Slopes::of(self.camera.width, self.camera.height, disparity, &self.noise)
    }
}

impl Drift {
    fn factor(&self, conditions: &Conditions) -> f64 {
        1.0 - self.relative * (-conditions.session_s / self.time_constant_s).exp_m1()
    }
}

/// What is known of the places of one image.
struct Known<'a> {
    conditions: &'a Conditions,
    slopes: Option<&'a Slopes>,
    pixels: Pixels<'a>,
    /// Those that can be evaluated.
    terms: Vec<&'a Term>,
    /// Does any of them ask for the tilt?
    tilt: bool,
}

impl Known<'_> {
    fn place(&self, i: usize) -> PixelContext {
        let mut place = self.pixels.place(i);
        place.session_s = self.conditions.session_s;
        place.temperature_c = self.conditions.temperature_c.unwrap_or(0.0);
        place.ambient = self.conditions.ambient_lux.unwrap_or(0.0);
        place
    }

    /// Put a surface of this disparity, px, before the pixel, leaning as the picture shows.
    fn stand(&self, place: &mut PixelContext, i: usize, disparity: f64) {
        let Pixels { camera, scale_px_m, .. } = self.pixels;
        place.at_disparity(disparity, scale_px_m);
        if let Some(slopes) = self.slopes {
            place.slope = slopes.at(i);
            if !self.tilt {
                return;
            }
            let [along_u, along_v] = place.slope;
            let (qx, qy) = (along_u * camera.fx / scale_px_m, along_v * camera.fy / scale_px_m);
            let qz = disparity / scale_px_m - qx * place.x - qy * place.y;
            place.lean_on(&Plane::new(nalgebra::Vector3::new(qx, qy, qz)), &self.pixels);
        }
    }
}
