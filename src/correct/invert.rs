//! Corrects one depth image: finds the disparity that the sensor's errors turn into the measured one.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::correction::{Conditions, Correction};
use super::slopes::Slopes;
use crate::error::{Error, Result};
use crate::measure::ColumnSteps;
use crate::plane::Plane;
use crate::terms::{LearntTerm, PixelContext, Pixels, ROOM_LUX, Term};

/// Change of the disparity at which the fixed-point iteration stops, px. Terms are evaluated at the corrected
/// disparity. The remaining error is smaller by the slope of the terms, 0.01 for a few tenths of a px over
/// tens of px: two rounds leave 1e-5 px. Steep terms, as of ranges at the corner of a wide camera, take some
/// twenty.
const CONVERGED_PX: f64 = 1e-3;
const MAX_ROUNDS: usize = 64;

impl Correction {
    /// Removes the biases from one depth image, m. NaN, where there is no measurement, stays NaN; a depth
    /// becomes infinite where the errors leave no disparity.
    /// Fails if the image does not have the sensor's size.
    pub fn apply(&self, depth_m: &mut [f32], conditions: &Conditions) -> Result<()> {
        if self.is_identity() {
            return self.refuse_size(depth_m);
        }
        let corrected = self.corrected(depth_m, conditions)?;
        depth_m.iter_mut().zip(corrected).for_each(|(z, depth)| *z = depth as f32);
        Ok(())
    }

    /// As [`Correction::apply`], in double precision.
    /// Fails if the image does not have the sensor's size.
    pub fn corrected(&self, depth_m: &[f32], conditions: &Conditions) -> Result<Vec<f64>> {
        self.refuse_size(depth_m)?;
        if self.is_identity() {
            return Ok(depth_m.iter().copied().map(f64::from).collect());
        }
        let known = self.known(depth_m, conditions);
        let one = |(i, &z): (usize, &f32)| match z > 0.0 {
            true => self.depth(i, z, &known),
            false => f64::from(z),
        };
        Ok(depth_m.par_iter().enumerate().map(one).collect())
    }

    pub(super) fn refuse_size(&self, depth_m: &[f32]) -> Result<()> {
        if depth_m.len() == self.camera.pixels() {
            return Ok(());
        }
        Err(Error::Argument {
            what: format!("{} depths for {} pixels", depth_m.len(), self.camera.pixels()),
            remedy: "give the whole image of the model's sensor, row by row",
        })
    }

    fn known<'a>(&'a self, depth_m: &[f32], conditions: &'a Conditions) -> Known<'a> {
        let factor = self.factor(conditions);
        let slopes = self.needs.slope.then(|| self.stored_slopes(depth_m, factor));
        let terms = self.terms.iter().filter(|(t, _)| conditions.determine(t)).collect();
        let pixels = Pixels::new(&self.camera, &self.rays, self.scale_px_m);
        let columns = self.columns(depth_m, factor);
        Known { conditions, factor, slopes, pixels, terms, columns, tilt: self.needs.tilt }
    }

    /// The corrected depth of a pixel whose stored depth is `z`, m.
    fn depth(&self, i: usize, z: f32, known: &Known<'_>) -> f64 {
        let steps = known.columns.get(i % self.camera.width).copied().unwrap_or(0.0);
        let measured = self.disparity(i, z, known.factor) - steps;
        let d = self.solve(i, measured, known);
        if d > 0.0 { self.scale_px_m / d } else { f64::INFINITY }
    }

    /// The disparity that the terms turn into `measured`, px.
    fn solve(&self, i: usize, measured: f64, known: &Known<'_>) -> f64 {
        if self.terms.is_empty() || measured <= 0.0 {
            return measured;
        }
        let mut place = known.place(i);
        let mut d = measured;
        for _ in 0..MAX_ROUNDS {
            known.stand(&mut place, i, d);
            let bias: f64 = known.terms.iter().map(|(t, px)| t.held_value(*px, &place)).sum();
            let next = measured - bias;
            if !next.is_finite() {
                return measured;
            }
            let change = (next - d).abs();
            d = next;
            if !self.needs.depth || change < CONVERGED_PX || d <= 0.0 {
                return d;
            }
        }
        d
    }

    /// Whether the model states the uncertainty of its biases.
    pub fn knows_uncertainty(&self) -> bool {
        !self.uncertainty.is_empty()
    }

    /// Standard uncertainty of the corrected depths `depth_m` from the learnt shapes, m; NaN where there is
    /// no depth, infinite where the depth is. Errors that planes cannot show are not included.
    /// Fails if the image does not have the sensor's size.
    pub fn uncertainty_m(&self, depth_m: &[f32], conditions: &Conditions) -> Result<Vec<f32>> {
        self.refuse_size(depth_m)?;
        let pixels = Pixels::new(&self.camera, &self.rays, self.scale_px_m);
        let slopes = self
            .uncertainty
            .needs
            .slope
            .then(|| self.slopes(depth_m, |_, z| self.scale_px_m / f64::from(z)));
        let tilt = self.uncertainty.needs.tilt;
        let (terms, columns) = (Vec::new(), Vec::new());
        let known = Known { conditions, factor: 1.0, slopes, pixels, terms, columns, tilt };
        let sigma = |parts: &mut Vec<f64>, (i, &z): (usize, &f32)| {
            let z = f64::from(z);
            if z == f64::INFINITY {
                return f32::INFINITY;
            }
            if !(z > 0.0 && z.is_finite()) {
                return f32::NAN;
            }
            let mut place = known.place(i);
            known.stand(&mut place, i, self.scale_px_m / z);
            let subtracted = |term: &Term| conditions.determine(term);
            let px = self.uncertainty.variance(&place, subtracted, parts).sqrt();
            (px * z * z / self.scale_px_m) as f32
        };
        Ok(depth_m.par_iter().enumerate().map_init(Vec::new, sigma).collect())
    }

    /// Predicted standard deviation of each stored depth, m: sigma at the corrected depth and the surface's
    /// tilt, scaled by the model's variance terms; NaN where there is no depth.
    /// Fails if the image does not have the sensor's size.
    pub fn sigma_m(&self, depth_m: &[f32], conditions: &Conditions) -> Result<Vec<f64>> {
        self.refuse_size(depth_m)?;
        let mut known = self.known(depth_m, conditions);
        let slopes = known.slopes.take();
        known.slopes = slopes.or_else(|| Some(self.stored_slopes(depth_m, known.factor)));
        known.tilt = true;
        let variance = || self.variance.iter().filter(|(t, _)| conditions.determine(t));
        let sigma = |(i, &z): (usize, &f32)| {
            let depth = if z > 0.0 { self.depth(i, z, &known) } else { 0.0 };
            if !(depth > 0.0 && depth.is_finite()) {
                return f64::NAN;
            }
            let mut place = known.place(i);
            known.stand(&mut place, i, self.scale_px_m / depth);
            let plain = self.sigma.axial_sigma(depth, place.theta);
            place.variance = (plain * place.disparity / depth).powi(2);
            let terms = variance().map(|(t, px)| t.held_value(*px, &place));
            plain * (0.5 * terms.sum::<f64>()).exp()
        };
        Ok(depth_m.par_iter().enumerate().map(sigma).collect())
    }

    /// Offset of each column in this image, px; empty unless the model has such offsets and the image shows
    /// them.
    fn columns(&self, depth_m: &[f32], factor: f64) -> Vec<f64> {
        if !self.column_steps {
            return Vec::new();
        }
        let disparity = |(i, &z): (usize, &f32)| match z > 0.0 {
            true => self.disparity(i, z, factor) as f32,
            false => f32::NAN,
        };
        let image: Vec<f32> = depth_m.iter().enumerate().map(disparity).collect();
        let width = self.camera.width;
        ColumnSteps::find(&image, width)
            .map_or_else(Vec::new, |steps| (0..width).map(|u| steps.error_px(u)).collect())
    }

    /// Slopes of the surfaces in an image of stored depths.
    fn stored_slopes(&self, depth_m: &[f32], factor: f64) -> Slopes {
        self.slopes(depth_m, |i, z| self.disparity(i, z, factor))
    }

    /// Slopes of the image's surfaces; `disparity` is that of a pixel with this depth, px.
    fn slopes(&self, depth_m: &[f32], disparity: impl Fn(usize, f32) -> f64 + Sync) -> Slopes {
        let disparity = |i: usize| match depth_m[i] {
            z if z > 0.0 => disparity(i, z),
            _ => f64::NAN,
        };
        Slopes::of(self.camera.width, self.camera.height, disparity, &self.noise)
    }
}

/// Quantities shared by all pixels of one image.
struct Known<'a> {
    conditions: &'a Conditions,
    /// Stored over true depth, the same for all pixels.
    factor: f64,
    slopes: Option<Slopes>,
    pixels: Pixels<'a>,
    /// Terms that can be evaluated.
    terms: Vec<&'a LearntTerm>,
    /// Offset of each column in this image, px; empty if there are none.
    columns: Vec<f64>,
    /// Whether any term needs the tilt.
    tilt: bool,
}

impl Known<'_> {
    fn place(&self, i: usize) -> PixelContext {
        let mut place = self.pixels.place(i);
        place.session_s = self.conditions.session_s;
        place.temperature_c = self.conditions.temperature_c.unwrap_or(0.0);
        place.ambient = self.conditions.ambient_lux.unwrap_or(ROOM_LUX);
        place
    }

    /// Places a surface of this disparity, px, at the pixel, tilted as the image shows.
    fn stand(&self, place: &mut PixelContext, i: usize, disparity: f64) {
        let Pixels { camera, scale_px_m, .. } = self.pixels;
        place.at_disparity(disparity, scale_px_m);
        if let Some(slopes) = &self.slopes {
            place.slope = slopes.at(i);
            if !self.tilt {
                return;
            }
            let [along_u, along_v] = place.slope;
            let (qx, qy) = (along_u * camera.fx / scale_px_m, along_v * camera.fy / scale_px_m);
            let qz = disparity / scale_px_m - qx * place.x - qy * place.y;
            place.lean_on(&Plane::new(Vector3::new(qx, qy, qz)), &self.pixels);
        }
    }
}
