//! One depth image: the disparity that the sensor's errors turn into the measured one.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::correction::{Conditions, Correction};
use super::slopes::Slopes;
use super::uncertainty::{Scratch, where_held};
use crate::error::{Error, Result};
use crate::plane::Plane;
use crate::terms::{PixelContext, Pixels, Term};

/// The error of a term is taken at the corrected disparity: substituted until it changes by less, px.
/// What is left is less again by the term's steepness, a hundredth for terms of a few tenths of a px
/// over tens of px: two rounds, and a hundred thousandth of a pixel.
const CONVERGED_PX: f64 = 1e-3;
const MAX_ROUNDS: usize = 8;

impl Correction {
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
        let factor = self.factor(conditions);
        let slopes = self.needs.slope.then(|| self.slopes(depth_m, factor));
        let pixels = Pixels::new(&self.camera, &self.rays, self.scale_px_m);
        let terms = self.terms.iter().filter(|(t, _)| conditions.determine(t)).collect();
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

    /// The disparity that the terms turn into `measured`, px.
    fn solve(&self, i: usize, measured: f64, known: &Known<'_>, scratch: &mut Vec<f64>) -> f64 {
        if self.terms.is_empty() || measured <= 0.0 {
            return measured;
        }
        let mut place = known.place(i);
        let mut d = measured;
        for _ in 0..MAX_ROUNDS {
            known.stand(&mut place, i, d);
            let bias: f64 = known.terms.iter().map(|t| held(t, &place, scratch)).sum();
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

    /// Does the model say how sure its biases are?
    pub fn knows_uncertainty(&self) -> bool {
        !self.uncertainty.is_empty()
    }

    /// Standard uncertainty of the corrected depths `depth_m`, m, as far as the learnt shapes go:
    /// NaN where there is no depth. What planes cannot see is no part of it.
    pub fn uncertainty_m(&self, depth_m: &[f32], conditions: &Conditions) -> Vec<f32> {
        let pixels = Pixels::new(&self.camera, &self.rays, self.scale_px_m);
        let slopes = self.uncertainty.needs.slope.then(|| self.slopes(depth_m, 1.0));
        let tilt = self.uncertainty.needs.tilt;
        let known = Known { conditions, slopes: slopes.as_ref(), pixels, terms: Vec::new(), tilt };
        let width = self.camera.width;
        let mut sigma = vec![f32::NAN; depth_m.len()];
        sigma.par_chunks_mut(width).enumerate().for_each(|(row, line)| {
            let mut scratch = Scratch::default();
            for (u, sigma) in line.iter_mut().enumerate() {
                let z = f64::from(depth_m[row * width + u]);
                if z > 0.0 && z.is_finite() {
                    let mut place = known.place(row * width + u);
                    known.stand(&mut place, row * width + u, self.scale_px_m / z);
                    let px = self.uncertainty.variance(&place, &mut scratch).sqrt();
                    *sigma = (px * z * z / self.scale_px_m) as f32;
                }
            }
        });
        sigma
    }

    fn slopes(&self, depth_m: &[f32], factor: f64) -> Slopes {
        let disparity = |i: usize| match depth_m[i] {
            z if z > 0.0 => self.disparity(i, z, factor),
            _ => f64::NAN,
        };
        Slopes::of(self.camera.width, self.camera.height, disparity, &self.noise)
    }
}

/// A term's value; what stands still in the picture and grows with the disparity is held where its
/// learning ended.
fn held((term, [low, high]): &(Term, [f64; 2]), place: &PixelContext, row: &mut Vec<f64>) -> f64 {
    term.value(&where_held(&term.basis, [*low, *high], place), row)
}

/// What is known of the places of one image.
struct Known<'a> {
    conditions: &'a Conditions,
    slopes: Option<&'a Slopes>,
    pixels: Pixels<'a>,
    /// Those that can be evaluated.
    terms: Vec<&'a (Term, [f64; 2])>,
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
            place.lean_on(&Plane::new(Vector3::new(qx, qy, qz)), &self.pixels);
        }
    }
}
