//! The pinhole camera: which ray of the optical frame a pixel looks along.
//!
//! Optical frame: x right (along the columns u), y down (along the rows v), z forward, metres.

use serde::{Deserialize, Serialize};

/// Pinhole intrinsics with the Brown-Conrady lens model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Image size, px.
    pub width: usize,
    pub height: usize,
    /// Focal lengths, px.
    pub fx: f64,
    pub fy: f64,
    /// Principal point, px; the centre of the first pixel is (0, 0).
    pub cx: f64,
    pub cy: f64,
    /// k1, k2, p1, p2, k3 as OpenCV orders them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<[f64; 5]>,
}

impl Camera {
    /// What is wrong with these numbers, if anything.
    pub fn fault(&self) -> Option<String> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        if !usable_size(self.width, self.height) {
            return Some(format!("image size {} x {} px is not usable", self.width, self.height));
        }
        if !positive(self.fx) || !positive(self.fy) {
            return Some(format!(
                "focal lengths fx = {}, fy = {} px must be positive",
                self.fx, self.fy
            ));
        }
        if !self.cx.is_finite() || !self.cy.is_finite() {
            return Some("the principal point cx, cy is not finite".into());
        }
        if self.distortion.is_some_and(|k| k.iter().any(|v| !v.is_finite())) {
            return Some("the distortion coefficients are not finite".into());
        }
        None
    }

    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Normalised image coordinates (x, y), so that the pixel's ray is (x, y, 1): dimensionless.
    ///
    /// With a lens model the ray is found by fixed-point iteration (as OpenCV's undistortPoints).
    pub fn ray(&self, u: f64, v: f64) -> (f64, f64) {
        let (xd, yd) = ((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        let Some(k) = self.distortion else {
            return (xd, yd);
        };
        let (mut x, mut y) = (xd, yd);
        for _ in 0..UNDISTORT_ITERATIONS {
            let (dx, dy, radial) = lens(&k, x, y);
            x = (xd - dx) / radial;
            y = (yd - dy) / radial;
        }
        (x, y)
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
const MOST_PIXELS: usize = 1 << 24;

pub(crate) fn usable_size(width: usize, height: usize) -> bool {
    let pixels = width.saturating_mul(height);
    (1..=MOST_PIXELS).contains(&pixels)
}

/// The map contracts by the size of the distortion; ten rounds are below 1e-9 px for a Kinect.
const UNDISTORT_ITERATIONS: usize = 10;

/// Tangential shift and radial factor of the Brown-Conrady model at the undistorted (x, y).
fn lens(k: &[f64; 5], x: f64, y: f64) -> (f64, f64, f64) {
    let [k1, k2, p1, p2, k3] = *k;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    let dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    (dx, dy, radial)
}

/// Normalised coordinates of every pixel, row-major, `width * height` long.
#[derive(Debug, Clone)]
pub struct Rays {
    pub x: Vec<f32>,
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
    fn project_inverts_ray_through_a_strong_lens() {
        let camera = Camera {
            width: 640,
            height: 480,
            fx: 580.0,
            fy: 578.0,
            cx: 321.5,
            cy: 238.25,
            distortion: Some([-0.26, 0.1, -7.6e-4, 5.0e-3, 0.02]),
        };
        for (u, v) in [(0.0, 0.0), (639.0, 479.0), (320.0, 240.0), (12.0, 400.0)] {
            let (x, y) = camera.ray(u, v);
            let (pu, pv) = camera.project(x, y);
            assert!((pu - u).abs() < 1e-3 && (pv - v).abs() < 1e-3, "{u} {v}: {pu} {pv}");
        }
    }

    #[test]
    fn zero_focal_length_is_a_fault() {
        let mut camera = Camera {
            width: 640,
            height: 480,
            fx: 0.0,
            fy: 578.0,
            cx: 0.0,
            cy: 0.0,
            distortion: None,
        };
        assert!(camera.fault().is_some());
        camera.fx = f64::NAN;
        assert!(camera.fault().is_some());
        camera.fx = 580.0;
        assert!(camera.fault().is_none());
    }
}
