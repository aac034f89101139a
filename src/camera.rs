//! The pinhole camera: which ray of the optical frame a pixel looks along.
//!
//! Optical frame: x right (along the columns u), y down (along the rows v), z forward, metres.

mod lens;

use lens::{folds, lens, undistorted};
use serde::{Deserialize, Serialize};

use crate::units::shortest;

/// Pinhole intrinsics with the Brown-Conrady lens model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    pub width: usize,
    pub height: usize,
    /// Focal length along the columns, px.
    pub fx: f64,
    /// Focal length along the rows, px.
    pub fy: f64,
    /// Column of the principal point, px; the centre of the first pixel is (0, 0).
    pub cx: f64,
    /// Row of the principal point, px.
    pub cy: f64,
    /// k1, k2, p1, p2, k3 as OpenCV orders them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<[f64; 5]>,
}

/// What can be wrong with a [`Camera`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CameraFault {
    /// No pixel, or more than any sensor has; px.
    #[error("image size {0} x {1} px is not usable")]
    Size(usize, usize),
    /// fx, fy, px.
    #[error("focal lengths fx = {}, fy = {} px must be positive", shortest(*.0), shortest(*.1))]
    FocalLength(f64, f64),
    /// cx or cy is no number.
    #[error("the principal point cx, cy is not finite")]
    PrincipalPoint,
    /// A distortion coefficient is no number.
    #[error("the distortion coefficients are not finite")]
    Coefficients,
    /// A pixel that no ray is bent to: undistortion does not settle there.
    #[error(
        "distortion {} has no ray for pixel ({u}, {v}); check the order of the coefficients and that they \
         belong to these fx, fy",
        listed(k)
    )]
    NoRay {
        /// k1, k2, p1, p2, k3.
        k: [f64; 5],
        /// Column of the first such pixel, px.
        u: usize,
        /// Its row, px.
        v: usize,
    },
    /// The image folds back on itself: rays farther out are bent to pixels farther in.
    #[error(
        "distortion {} folds the image inside its corners; check the order of the coefficients and that they \
         belong to these fx, fy", listed(.0)
    )]
    Fold([f64; 5]),
}

fn listed(k: &[f64; 5]) -> String {
    format!("[k1, k2, p1, p2, k3] = [{}]", k.map(shortest).join(", "))
}

impl Camera {
    /// Its principal point in the image's middle, square pixels, no lens errors.
    pub fn centred(width: usize, height: usize, focal_px: f64) -> Self {
        let [cx, cy] = [width, height].map(|n| (n as f64 - 1.0) / 2.0);
        Camera { width, height, fx: focal_px, fy: focal_px, cx, cy, distortion: None }
    }

    /// What is wrong with these numbers, if anything. With a lens model every pixel is tried.
    pub fn fault(&self) -> Option<CameraFault> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        if !usable_size(self.width, self.height) {
            return Some(CameraFault::Size(self.width, self.height));
        }
        if !positive(self.fx) || !positive(self.fy) {
            return Some(CameraFault::FocalLength(self.fx, self.fy));
        }
        if !self.cx.is_finite() || !self.cy.is_finite() {
            return Some(CameraFault::PrincipalPoint);
        }
        self.distortion.and_then(|k| self.lens_fault(k))
    }

    fn lens_fault(&self, k: [f64; 5]) -> Option<CameraFault> {
        if k.iter().any(|v| !v.is_finite()) {
            return Some(CameraFault::Coefficients);
        }
        let mut farthest: f64 = 0.0;
        for v in 0..self.height {
            for u in 0..self.width {
                let (x, y) = self.ray(u as f64, v as f64);
                if x.is_nan() || y.is_nan() {
                    return Some(CameraFault::NoRay { k, u, v });
                }
                farthest = farthest.max(x * x + y * y);
            }
        }
        folds(&k, farthest).then_some(CameraFault::Fold(k))
    }

    /// Number of pixels of an image.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Normalised image coordinates (x, y), so that the pixel's ray is (x, y, 1): dimensionless.
    ///
    /// With a lens model the ray is found by fixed-point iteration (as OpenCV's undistortPoints);
    /// NaN where that does not settle, which [`Camera::fault`] reports beforehand.
    pub fn ray(&self, u: f64, v: f64) -> (f64, f64) {
        let (xd, yd) = ((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        match self.distortion {
            Some(k) => undistorted(&k, xd, yd).unwrap_or((f64::NAN, f64::NAN)),
            None => (xd, yd),
        }
    }

    /// Where the ray (x, y, 1) meets the image, px: the inverse of [`Camera::ray`].
    pub fn project(&self, x: f64, y: f64) -> (f64, f64) {
        let (x, y) = match self.distortion {
            Some(k) => {
                let (dx, dy, radial) = lens(&k, x, y);
                (x * radial + dx, y * radial + dy)
            }
            None => (x, y),
        };
        (self.fx * x + self.cx, self.fy * y + self.cy)
    }

    /// The rays of all pixels, row by row.
    pub fn rays(&self) -> Rays {
        let mut x = Vec::with_capacity(self.pixels());
        let mut y = Vec::with_capacity(self.pixels());
        for v in 0..self.height {
            for u in 0..self.width {
                let (rx, ry) = self.ray(u as f64, v as f64);
                x.push(rx as f32);
                y.push(ry as f32);
            }
        }
        Rays { x, y }
    }
}

/// 16 megapixels are ten times what any depth sensor has; more is a slip or damage, and the rays
/// of all pixels would take gigabytes before the first image shows the contradiction.
const MAX_PIXELS: usize = 1 << 24;

pub(crate) fn usable_size(width: usize, height: usize) -> bool {
    let pixels = width.saturating_mul(height);
    (1..=MAX_PIXELS).contains(&pixels)
}

/// Normalised coordinates of every pixel, row-major, `width * height` long.
#[derive(Debug, Clone)]
pub struct Rays {
    /// x of the ray (x, y, 1): right, dimensionless.
    pub x: Vec<f32>,
    /// y of the ray (x, y, 1): down, dimensionless.
    pub y: Vec<f32>,
}

impl Rays {
    /// (x, y) of pixel `i` in double precision.
    pub fn at(&self, i: usize) -> (f64, f64) {
        (f64::from(self.x[i]), f64::from(self.y[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_focal_length_is_a_fault() {
        for (fx, good) in [(0.0, false), (f64::NAN, false), (580.0, true)] {
            let camera = Camera { fx, ..Camera::centred(640, 480, 578.0) };
            assert_eq!(camera.fault().is_none(), good, "{fx}");
        }
    }
}
