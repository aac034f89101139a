//! What a correction is made of, for programs that do the same elsewhere.

use super::correction::{Correction, Drift};
use crate::camera::Camera;
use crate::model::SigmaModel;
use crate::terms::{Needs, Term};

/// A term of the model with the disparities at which it was learnt, px.
pub type LearntTerm = (Term, [f64; 2]);

/// The parts of a [`Correction`], in the order in which they are taken out of a depth.
#[derive(Debug, Clone, Copy)]
pub struct Parts<'a> {
    pub camera: &'a Camera,
    /// Disparity in px times depth in m.
    pub scale_px_m: f64,
    /// Stored depth over true depth.
    pub scale: f64,
    pub drifts: &'a [Drift],
    /// Share of the ray's excess over the depth that is stored.
    pub ray_share: f64,
    /// Terms of the disparity that depend on the pixel alone.
    pub still: &'a [Term],
    /// Height of a pixel locking's sine, px, and what undoes it at even phases from 0 to 1.
    pub locking: Option<(f64, &'a [f64])>,
    /// The other terms of the disparity, and what they look at.
    pub terms: &'a [LearntTerm],
    pub needs: Needs,
    /// Terms of the logarithm of the variance.
    pub variance: &'a [LearntTerm],
    pub sigma: &'a SigmaModel,
    /// Variance up to which a window is believed to lie on one surface, px^2, a node a px of disparity.
    pub window_limits: &'a [f64],
}

impl Correction {
    pub fn parts(&self) -> Parts<'_> {
        Parts {
            camera: &self.camera,
            scale_px_m: self.scale_px_m,
            scale: self.scale,
            drifts: &self.drifts,
            ray_share: self.ray_share,
            still: &self.still_terms,
            locking: self.locking.as_ref().map(|l| (l.amplitude_px(), l.shifts())),
            terms: &self.terms,
            needs: self.needs,
            variance: &self.variance,
            sigma: &self.sigma,
            window_limits: self.noise.limits(),
        }
    }
}
