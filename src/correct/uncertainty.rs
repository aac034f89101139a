//! How sure a correction is, pixel by pixel.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::correction::{Conditions, Correction};
use super::invert::Known;
use crate::model;
use crate::terms::{Needs, PixelContext, Pixels, Term};

/// The covariance of what a correction takes out.
#[derive(Debug, Clone, Default)]
pub(super) struct Uncertainty {
    shapes: Vec<Spread>,
    /// The parts that err together, by the fit they are of and their number there.
    parts: BTreeMap<(u32, usize), usize>,
    pub needs: Needs,
}

/// One shape of it.
#[derive(Debug, Clone)]
struct Spread {
    term: (Term, [f64; 2]),
    /// What one standard deviation of a part makes of each coefficient: part, coefficients.
    parts: Vec<(usize, Vec<f64>)>,
    /// Variance of each coefficient's own; empty for none.
    own: Vec<f64>,
}

impl Uncertainty {
    /// The terms of `entry` that are `usable`, learnt at these disparities.
    pub fn add(
        &mut self,
        entry: &model::Effect,
        learnt: [f64; 2],
        usable: impl Fn(&&Term) -> bool,
    ) {
        let Some(covariance) = &entry.covariance else { return };
        let mut first = 0;
        for term in &entry.shape {
            let span = first..first + term.coefficients.len();
            first = span.end;
            if !usable(&term) {
                continue;
            }
            let mut parts = Vec::new();
            for (k, factor) in covariance.factors.iter().enumerate() {
                let next = self.parts.len();
                let part = *self.parts.entry((covariance.fit, k)).or_insert(next);
                parts.extend(factor.get(span.clone()).map(|f| (part, f.to_vec())));
            }
            let own = covariance.variances.get(span).unwrap_or_default().to_vec();
            self.needs = self.needs.and(term.needs());
            self.shapes.push(Spread { term: (term.clone(), learnt), parts, own });
        }
    }

    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// Variance at a place, px^2.
    fn variance(&self, place: &PixelContext, scratch: &mut Scratch) -> f64 {
        scratch.parts.clear();
        scratch.parts.resize(self.parts.len(), 0.0);
        let mut own = 0.0;
        for Spread { term: (term, learnt), parts, own: variances } in &self.shapes {
            let at = super::invert::where_held(&term.basis, *learnt, place);
            scratch.row.clear();
            scratch.row.resize(term.basis.count(), 0.0);
            term.basis.fill(&at, &mut scratch.row);
            scratch.touched.clear();
            scratch.touched.extend((0..scratch.row.len()).filter(|&j| scratch.row[j] != 0.0));
            for (part, coefficients) in parts {
                let touched = scratch.touched.iter();
                scratch.parts[*part] +=
                    touched.map(|&j| scratch.row[j] * coefficients[j]).sum::<f64>();
            }
            if !variances.is_empty() {
                let touched = scratch.touched.iter();
                own += touched.map(|&j| scratch.row[j].powi(2) * variances[j]).sum::<f64>();
            }
        }
        own + scratch.parts.iter().map(|p| p * p).sum::<f64>()
    }
}

#[derive(Default)]
struct Scratch {
    row: Vec<f64>,
    touched: Vec<usize>,
    parts: Vec<f64>,
}

impl Correction {
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
}
