//! The depth image for the target search, and the first plane through some pixels.

use nalgebra::{Matrix3, Vector3};

use super::Plane;
use super::affine::{AffineFit, Effort, MAD_TO_SIGMA, fit_affine_robust};
use super::ransac::{RansacOptions, ransac};
use crate::camera::{Camera, Rays};
use crate::rng::Stream;
use crate::stats::median_in_place;

/// The pixels of the target and a first plane through them.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Indices into the image, ascending: all pixels of the target's region, except those at the picture's
    /// border that lie beside it. Pixels without a measurement and off the plane are included, because holes
    /// and gross errors belong to the sensor's noise.
    pub pixels: Vec<u32>,
    pub plane: Plane,
    /// Robust standard deviation about the plane, inverse depth, 1/m.
    pub scale: f64,
    pub exclusions: Exclusions,
    pub notes: Vec<String>,
}

/// Pixels that were not used, by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Exclusions {
    /// Pixels considered: the region's, or the whole image.
    pub considered: usize,
    pub invalid: usize,
    /// Measured, but not on the target's plane (or not connected with it).
    pub off_plane: usize,
    /// On the plane, but so near the target's edge that the depth may be mixed.
    pub edge: usize,
}

/// A depth image for the target search, in inverse depth (1/m, NaN = none).
pub struct InverseDepthImage<'a> {
    pub w: &'a [f32],
    pub rays: &'a Rays,
    pub camera: &'a Camera,
    /// Step of the depth code in inverse depth at an inverse depth, 1/m.
    pub step: &'a (dyn Fn(f64) -> f64 + Sync),
}

/// Fewest pixels of a target.
pub(crate) const MIN_PIXELS: usize = 300;
/// Pixels within this many robust standard deviations belong to the plane.
const REACH_SIGMAS: f64 = 5.0;
/// ... and pixels within this distance always do: lens errors of a Kinect bend a near wall by
/// 8 mm, while a hand holding a board stands off by more.
const REACH_FLOOR_M: f64 = 0.010;
/// Lower bound of any structured-light sensor's standard deviation, as a + b z^2 (m): half of Khoshelham and
/// Elberink's 1.425e-3 z^2, and of a millimetre of rounding.
const SIGMA_FLOOR_M: f64 = 0.0005;
const SIGMA_FLOOR_PER_M: f64 = 0.0007;

/// Largest scatter of a surface, as a share of its distance: a Kinect at 8 m reaches 2 %.
const ROUGHEST: f64 = 0.05;

impl InverseDepthImage<'_> {
    /// Least plausible standard deviation at inverse depth `w`, 1/m.
    pub(super) fn floor(&self, w: f64) -> f64 {
        (0.3 * (self.step)(w)).max(SIGMA_FLOOR_M * w * w + SIGMA_FLOOR_PER_M)
    }

    pub(super) fn reach(&self, w: f64, scale: f64) -> f64 {
        (REACH_SIGMAS * scale).max(REACH_FLOOR_M * w * w)
    }

    /// Local noise of the image, whatever its shape: second differences over nine pixels cancel planes and
    /// are wider than a matching window's correlation. Nine is odd, and both rows and columns are used: an
    /// error that alternates from line to line is the sensor's noise, not relief.
    pub(super) fn local_noise(&self, pixels: &[u32]) -> f64 {
        const LAG: usize = 9;
        let width = self.camera.width;
        let stride = (pixels.len() / 3000).max(1);
        let along = |step: usize, length: usize| {
            let mut differences: Vec<f32> = pixels
                .iter()
                .step_by(stride)
                .map(|&i| i as usize)
                .filter(|i| (LAG..length.saturating_sub(LAG)).contains(&(i / step % length)))
                .map(|i| (self.w[i - LAG * step] - 2.0 * self.w[i] + self.w[i + LAG * step]).abs())
                .filter(|d| d.is_finite())
                .collect();
            f64::from(median_in_place(&mut differences))
        };
        let mad = along(1, width).max(along(width, self.camera.height));
        if mad.is_finite() { MAD_TO_SIGMA * mad / 6f64.sqrt() } else { 0.0 }
    }

    /// Whether the residual of a fit exceeds the scatter of any sensor.
    pub(super) fn too_rough(&self, fit: &AffineFit, pixels: &[u32]) -> bool {
        let mut w: Vec<f32> = pixels.iter().map(|&i| self.w[i as usize]).collect();
        fit.scale > ROUGHEST * f64::from(median_in_place(&mut w))
    }

    pub(super) fn valid(&self, i: usize) -> bool {
        self.w[i].is_finite()
    }
}

/// Whether the pixel's ray meets the plane in front of the camera.
pub(super) fn in_front(image: &InverseDepthImage<'_>, plane: &Plane, i: usize) -> bool {
    plane.inverse_depth_at(image.rays, i) > 0.0
}

pub(super) fn on_plane(image: &InverseDepthImage<'_>, fit: &AffineFit, i: usize) -> bool {
    let expected = fit.plane.inverse_depth_at(image.rays, i);
    expected > 0.0 && (f64::from(image.w[i]) - expected).abs() < image.reach(expected, fit.scale)
}

/// Hypotheses for a seed: enough for a plane that covers a quarter of the window.
const SEED_HYPOTHESES: usize = 300;
const SEED_SAMPLES: usize = 900;

/// Fits a first plane: RANSAC on a sample of `pixels`, affine through three, then the robust fit on all.
pub(super) fn seed_plane(
    image: &InverseDepthImage<'_>,
    pixels: &[u32],
    rng: &mut Stream,
) -> Option<AffineFit> {
    let stride = (pixels.len() / SEED_SAMPLES).max(1);
    let rows: Vec<(Vector3<f64>, f64)> = pixels
        .iter()
        .step_by(stride)
        .map(|&i| {
            let (x, y) = image.rays.at(i as usize);
            (Vector3::new(x, y, 1.0), f64::from(image.w[i as usize]))
        })
        .collect();
    let mut depths: Vec<f32> = rows.iter().map(|r| r.1 as f32).collect();
    let floor = image.floor(f64::from(median_in_place(&mut depths)));
    let options = RansacOptions {
        threshold_m: 2.5 * image.local_noise(pixels).max(floor),
        iterations: SEED_HYPOTHESES,
        confidence: SEED_CONFIDENCE,
    };
    let hypothesis = |three: [usize; 3]| {
        let [a, b, c] = three.map(|i| rows[i]);
        let m = Matrix3::from_rows(&[a.0.transpose(), b.0.transpose(), c.0.transpose()]);
        // Twice the area of the triangle in the normalised image; thin triangles extrapolate badly.
        if m.determinant().abs() < 1e-6 {
            return None;
        }
        m.lu().solve(&Vector3::new(a.1, b.1, c.1)).filter(|q| q.iter().all(|v| v.is_finite()))
    };
    let distance = |q: &Vector3<f64>, i: usize| (rows[i].1 - q.dot(&rows[i].0)).abs();
    let jury: Vec<usize> = (0..rows.len()).collect();
    let q = ransac(rows.len(), &options, rng, &jury, hypothesis, distance)?;
    fit_affine_robust(image.w, image.rays, pixels, &Plane::new(q), floor, Effort::Sample)
}

const SEED_CONFIDENCE: f64 = 0.9999;
