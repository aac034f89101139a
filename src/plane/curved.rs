//! Accepts a smooth but bent surface over the whole region: a wall seen by a sensor that gives the range
//! instead of the depth, or whose lens bends the picture. The diagnosis finds the cause, so such a view is
//! measured with a note instead of refused. Corners, spheres and clutter are still refused: no polynomial
//! fits them.

use nalgebra::{SMatrix, SVector};

use super::Plane;
use super::affine::{AffineFit, Effort, MAD_TO_SIGMA, fit_affine_robust};
use super::image::{Exclusions, InverseDepthImage, MIN_PIXELS, Target};
use crate::stats::{TUKEY, median_in_place};
use crate::units::{shortest, to_digits};

/// Terms of a polynomial of the fourth degree in (x, y): its error for 1/cos, which the range over a wall
/// follows, is 0.1 % at 40 degrees off the axis.
const TERMS: usize = 15;
const DEGREE: i32 = 4;
/// Pixels that the polynomial is fitted to.
const SAMPLES: usize = 6000;
const ROUNDS: usize = 8;
/// Largest residual of a smooth surface, as a multiple of the image's local noise: the same as for a plane.
const SMOOTH: f64 = 4.0;
/// ... and the least share of the measured pixels within the biweight.
const HELD: f64 = 0.9;
/// Least measured share: a picture with less shows an object, not a wall.
const MIN_MEASURED: f64 = 0.6;
/// Largest bend, relative to that of a range in place of the depth, which no error of a sensor exceeds; the
/// factor allows for tilt. A ball bends more over so small a part of the picture.
const MAX_BEND: f64 = 1.2;

/// Returns all of `inside` as a target, if one smooth surface fills it. `valid` are its measured pixels.
pub(super) fn curved_target(
    image: &InverseDepthImage<'_>,
    inside: &[u32],
    valid: &[u32],
) -> Option<Target> {
    if valid.len() < MIN_PIXELS || (valid.len() as f64) < MIN_MEASURED * inside.len() as f64 {
        return None;
    }
    let noise = image.local_noise(valid).max(image.floor(mean_inverse_depth(image, valid)));
    let surface = Surface::fit(image, valid, noise)?;
    let plane = Plane::new(surface.tangent());
    let fit = fit_affine_robust(image.w, image.rays, valid, &plane, noise, Effort::Sample)?;
    let (mut bend, mut range) = (0.0, 0.0);
    for (x, y) in valid.iter().map(|&i| image.rays.at(i as usize)) {
        let expected = fit.plane.inverse_depth(x, y);
        let off = (surface.at(x, y) / expected - 1.0).abs();
        bend = f64::max(bend, if expected > 0.0 { off } else { f64::INFINITY });
        range = f64::max(range, (1.0 + x * x + y * y).sqrt() - 1.0);
    }
    let rough = image.too_rough(&AffineFit { scale: surface.scale, ..fit }, valid);
    let smooth = surface.scale < SMOOTH * noise && surface.held > HELD;
    if rough || !smooth || bend > MAX_BEND * range {
        return None;
    }
    Some(target(image, inside, valid, &fit, bend))
}

fn target(
    image: &InverseDepthImage<'_>,
    inside: &[u32],
    valid: &[u32],
    fit: &AffineFit,
    bend: f64,
) -> Target {
    let exclusions = Exclusions {
        considered: inside.len(),
        invalid: inside.len() - valid.len(),
        ..Exclusions::default()
    };
    let note = format!(
        "the surface is smooth but bent, by up to {} % of its distance: taken for a plane that the \
         sensor bends; if it is itself curved, use a flat one",
        shortest(to_digits(100.0 * bend, 2))
    );
    let on_plane = |&i: &u32| fit.plane.inverse_depth_at(image.rays, i as usize);
    // Holes farther than all measured pixels are beyond the sensor's range, not losses.
    let farthest = valid.iter().map(on_plane).fold(f64::INFINITY, f64::min);
    let pixels = inside.iter().copied().filter(|i| on_plane(i) >= farthest).collect();
    Target { pixels, plane: fit.plane, scale: fit.scale, exclusions, notes: vec![note] }
}

fn mean_inverse_depth(image: &InverseDepthImage<'_>, pixels: &[u32]) -> f64 {
    pixels.iter().map(|&i| f64::from(image.w[i as usize])).sum::<f64>() / pixels.len() as f64
}

/// Inverse depth as a polynomial of the ray, 1/m.
struct Surface {
    coefficients: SVector<f64, TERMS>,
    /// Robust standard deviation about it, 1/m.
    scale: f64,
    /// Share of the pixels within the biweight.
    held: f64,
}

impl Surface {
    fn fit(image: &InverseDepthImage<'_>, pixels: &[u32], floor: f64) -> Option<Self> {
        let stride = (pixels.len() / SAMPLES).max(1);
        let rows: Vec<(SVector<f64, TERMS>, f64)> = pixels
            .iter()
            .step_by(stride)
            .map(|&i| {
                let (x, y) = image.rays.at(i as usize);
                (terms(x, y), f64::from(image.w[i as usize]))
            })
            .collect();
        let mut surface =
            Surface { coefficients: SVector::zeros(), scale: f64::INFINITY, held: 0.0 };
        for _ in 0..ROUNDS {
            let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
            let mut right = SVector::<f64, TERMS>::zeros();
            for (row, w) in &rows {
                let weight = surface.weight(w - surface.coefficients.dot(row));
                normal.syger(weight, row, row, 1.0);
                right += row * (weight * w);
            }
            surface.coefficients = normal.cholesky()?.solve(&right);
            let off = |(row, w): &(SVector<f64, TERMS>, f64)| w - surface.coefficients.dot(row);
            let mut sizes: Vec<f32> = rows.iter().map(|r| off(r).abs() as f32).collect();
            surface.scale = (MAD_TO_SIGMA * f64::from(median_in_place(&mut sizes))).max(floor);
            let held = sizes.iter().filter(|s| f64::from(**s) < TUKEY * surface.scale).count();
            surface.held = held as f64 / rows.len() as f64;
        }
        Some(surface)
    }

    fn weight(&self, off: f64) -> f64 {
        let t = off / (TUKEY * self.scale);
        (1.0 - t * t).max(0.0).powi(2)
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        self.coefficients.dot(&terms(x, y))
    }

    /// The tangent plane on the axis.
    fn tangent(&self) -> nalgebra::Vector3<f64> {
        let c = &self.coefficients;
        nalgebra::Vector3::new(c[2], c[1], c[0])
    }
}

/// 1, y, x, y^2, xy, x^2, ...
fn terms(x: f64, y: f64) -> SVector<f64, TERMS> {
    let powers = (0..=DEGREE).flat_map(|d| (0..=d).map(move |k| (k, d - k)));
    SVector::from_iterator(powers.map(|(k, l)| x.powi(k) * y.powi(l)))
}
