//! The pinhole camera with the Brown-Conrady lens: the ray of each pixel in the optical frame.
//!
//! Optical frame: x right (along the columns u), y down (along the rows v), z forward, metres.

use nalgebra::RealField;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::units::shortest;

/// Pinhole intrinsics with the Brown-Conrady lens model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Camera {
    pub width: usize,
    pub height: usize,
    pub fx: f64,
    pub fy: f64,
    /// Column of the principal point, px; the centre of the first pixel is (0, 0).
    pub cx: f64,
    pub cy: f64,
    /// k1, k2, p1, p2, k3 as OpenCV orders them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<[f64; 5]>,
}

fn listed(k: &[f64; 5]) -> String {
    format!("[k1, k2, p1, p2, k3] = [{}]", k.map(shortest).join(", "))
}

impl Camera {
    /// The principal point in the middle of the image, square pixels, no distortion.
    pub fn centred(width: usize, height: usize, focal_px: f64) -> Self {
        let [cx, cy] = [width, height].map(|n| (n as f64 - 1.0) / 2.0);
        Camera { width, height, fx: focal_px, fy: focal_px, cx, cy, distortion: None }
    }

    /// What is wrong with these numbers, if anything; where it begins with a key, that key's line in the file
    /// is named. With a lens model every pixel is checked.
    pub fn fault(&self) -> Option<String> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let Camera { width, height, fx, fy, cx, cy, distortion } = *self;
        let [focal_x, focal_y, x, y] = [fx, fy, cx, cy].map(shortest);
        let (field_deg, [narrow, wide]) = (self.field_of_view().to_degrees(), FIELD_DEG);
        Some(if !usable_size(width, height) {
            format!("width x height, {width} x {height} px, is no image size")
        } else if !positive(fx) || !positive(fy) {
            let key = if positive(fx) { "fy" } else { "fx" };
            format!("{key}: focal lengths fx = {focal_x}, fy = {focal_y} px must be positive")
        } else if !cx.is_finite() || !cy.is_finite() {
            "the principal point cx, cy is not finite".into()
        } else if !inside(cx, width) || !inside(cy, height) {
            let key = if inside(cx, width) { "cy" } else { "cx" };
            format!(
                "{key}: the principal point ({x}, {y}) lies outside the image of {width} x {height} px; check the \
                 order fx, fy, cx, cy and that they belong to this image size"
            )
        } else if !(1.0 / MAX_ASPECT..=MAX_ASPECT).contains(&(fx / fy)) {
            format!(
                "fx = {focal_x} and fy = {focal_y} px differ by more than a quarter, which no depth sensor's do; \
                 check the order fx, fy, cx, cy"
            )
        } else if !(narrow..=wide).contains(&field_deg) {
            format!(
                "a field of view of {field_deg:.1} degrees is no depth sensor's ({narrow} to {wide}); check fx, and \
                 that it belongs to this image size"
            )
        } else {
            return distortion.and_then(|k| self.lens_fault(&k));
        })
    }

    fn lens_fault(&self, k: &[f64; 5]) -> Option<String> {
        const BELONG: &str =
            "check the order of the coefficients and that they belong to these fx, fy";
        if k.iter().any(|v| !v.is_finite()) {
            return Some("the distortion coefficients are not finite".into());
        }
        if k[2].abs().max(k[3].abs()) > TANGENTIAL {
            return Some(format!(
                "distortion {}: p1 and p2 lie within -{TANGENTIAL} and {TANGENTIAL} (lenses have some thousandths); \
                 check the order of the coefficients",
                listed(k)
            ));
        }
        let mut farthest: f64 = 0.0;
        for v in 0..self.height {
            for (u, (x, y)) in self.row(v).enumerate() {
                // Undistortion does not converge there.
                if x.is_nan() || y.is_nan() {
                    let what = format!("has no ray for pixel ({u}, {v})");
                    return Some(format!("distortion {} {what}; {BELONG}", listed(k)));
                }
                farthest = farthest.max(x * x + y * y);
            }
        }
        // Rays farther out map to pixels farther in.
        let what = "folds the image inside its corners";
        folds(k, farthest).then(|| format!("distortion {} {what}; {BELONG}", listed(k)))
    }

    /// Horizontal field of view, ignoring distortion, rad.
    fn field_of_view(&self) -> f64 {
        ((self.cx + 0.5) / self.fx).atan() + ((self.width as f64 - 0.5 - self.cx) / self.fx).atan()
    }

    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Normalised image coordinates (x, y), so that the pixel's ray is (x, y, 1): dimensionless.
    ///
    /// With a lens model the ray is found by Newton's method; NaN where that does not converge, which
    /// [`Camera::fault`] reports beforehand.
    pub fn ray(&self, u: f64, v: f64) -> (f64, f64) {
        let [xd, yd] = self.bent(u, v);
        self.ray_near(u, v, (xd, yd))
    }

    fn ray_near(&self, u: f64, v: f64, start: (f64, f64)) -> (f64, f64) {
        let [xd, yd] = self.bent(u, v);
        let Some(k) = self.distortion else { return (xd, yd) };
        let cold = || undistorted(&k, [xd, yd], (xd, yd));
        let outwards = || followed(&k, [xd, yd]);
        let found = undistorted(&k, [xd, yd], start).or_else(cold).or_else(outwards);
        found.unwrap_or((f64::NAN, f64::NAN))
    }

    /// Distorted normalised coordinates of a pixel.
    fn bent(&self, u: f64, v: f64) -> [f64; 2] {
        [(u - self.cx) / self.fx, (v - self.cy) / self.fy]
    }

    /// The rays of a row; the search for each starts at the extrapolation of the two before it.
    fn row(&self, v: usize) -> impl Iterator<Item = (f64, f64)> {
        let mut before: [Option<(f64, f64)>; 2] = [None, None];
        (0..self.width).map(move |u| {
            let (u, v) = (u as f64, v as f64);
            let ray = match before {
                [Some(a), Some(b)] => self.ray_near(u, v, (2.0 * b.0 - a.0, 2.0 * b.1 - a.1)),
                _ => self.ray(u, v),
            };
            before = [before[1], Some(ray)];
            ray
        })
    }

    /// Projects the ray (x, y, 1) to pixel coordinates: the inverse of [`Camera::ray`].
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
            for (rx, ry) in self.row(v) {
                x.push(rx as f32);
                y.push(ry as f32);
            }
        }
        Rays { x, y }
    }
}

/// Limit of fx over fy and of its inverse: pixels are square to a percent. With cx and cy in their place
/// the ratio is 1.33, for images of 4:3 with the principal point in the middle.
const MAX_ASPECT: f64 = 1.25;
/// Limit of tangential distortion, beyond any usable lens. Within it, all of 5,000 random lenses gave the
/// rays of twenty random places; of lenses up to 0.5, one in a hundred did not.
const TANGENTIAL: f64 = 0.1;
/// Accepted fields of view, degrees. The widest depth camera has 127 (OAK-D W), and a hundred columns cut
/// out of a Kinect's image 10. Focal lengths in mm or as a share of the image width fall outside.
const FIELD_DEG: [f64; 2] = [2.0, 140.0];

/// Whether this coordinate, px, lies on one of `size` pixels.
fn inside(at: f64, size: usize) -> bool {
    (-0.5..=size as f64 - 0.5).contains(&at)
}

/// 16 megapixels, ten times what any depth sensor has. More is a mistake or damage, and the rays of all
/// pixels would take gigabytes before the first image shows the contradiction.
const MAX_PIXELS: usize = 1 << 24;

pub(crate) fn usable_size(width: usize, height: usize) -> bool {
    let pixels = width.saturating_mul(height);
    (1..=MAX_PIXELS).contains(&pixels)
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

/// Newton's method doubles the digits each round; near a fold it halves the error, from 1 to 1e-6 in 20.
const MAX_ROUNDS: usize = 30;
/// Converged below this change of the normalised coordinates: the remaining error, its square, is 1e-9 px
/// at 1000 px of focal length.
const SETTLED: f64 = 1e-6;

/// The ray (x, y, 1) that the lens maps to (xd, yd, 1), by Newton's method from `start`.
fn undistorted(k: &[f64; 5], [xd, yd]: [f64; 2], start: (f64, f64)) -> Option<(f64, f64)> {
    let [k1, k2, p1, p2, k3] = *k;
    let (mut x, mut y) = start;
    for _ in 0..MAX_ROUNDS {
        let (dx, dy, radial) = lens(k, x, y);
        let (off_x, off_y) = (x * radial + dx - xd, y * radial + dy - yd);
        let r2 = x * x + y * y;
        let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let along_x = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
        let along_y = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
        let across = x * y * slope + 2.0 * (p1 * x + p2 * y);
        let det = along_x * along_y - across * across;
        let step_x = (along_y * off_x - across * off_y) / det;
        let step_y = (along_x * off_y - across * off_x) / det;
        (x, y) = (x - step_x, y - step_y);
        if step_x.abs().max(step_y.abs()) < SETTLED {
            // Rejects solutions beyond a fold, where the image is mirrored or the ray is across the axis.
            return (radial > 0.0 && det > 0.0 && along_x > 0.0).then_some((x, y));
        }
    }
    None
}

/// Continuation steps outwards from the axis, for a ray that is not found directly.
const STEPS: u32 = 32;

/// As [`undistorted`] for strong distortion: by continuation, each step starting from the ray before.
fn followed(k: &[f64; 5], [xd, yd]: [f64; 2]) -> Option<(f64, f64)> {
    (1..=STEPS).try_fold((0.0, 0.0), |before, n| {
        let share = f64::from(n) / f64::from(STEPS);
        undistorted(k, [share * xd, share * yd], before)
    })
}

/// Whether the distorted radius r (1 + k1 s + k2 s^2 + k3 s^3), s = r^2, decreases anywhere up to
/// s = `farthest`. Its slope 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3 is least at the end or where its own
/// derivative is zero.
fn folds(k: &[f64; 5], farthest: f64) -> bool {
    let [k1, k2, _, _, k3] = *k;
    let slope = |s: f64| 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * 7.0 * k3));
    let (a, b, c) = (21.0 * k3, 10.0 * k2, 3.0 * k1);
    let root = (b * b - 4.0 * a * c).sqrt();
    // Both roots in the form without cancellation; NaN and infinity fall outside the range.
    let q = -0.5 * (b + b.signum() * root);
    let mut places = [farthest, q / a, c / q].into_iter().filter(|s| (0.0..=farthest).contains(s));
    places.any(|s| slope(s) <= 0.0)
}

/// Tangential shift and radial factor of the Brown-Conrady model at the undistorted (x, y), in either
/// precision.
#[inline]
pub(crate) fn lens<T: RealField + Copy>(k: &[T; 5], x: T, y: T) -> (T, T, T) {
    let [k1, k2, p1, p2, k3] = *k;
    let r2 = x * x + y * y;
    let radial = T::one() + r2 * (k1 + r2 * (k2 + r2 * k3));
    let two = T::one() + T::one();
    let dx = two * p1 * x * y + p2 * (r2 + two * x * x);
    let dy = p1 * (r2 + two * y * y) + two * p2 * x * y;
    (dx, dy, radial)
}

#[cfg(test)]
mod tests;
