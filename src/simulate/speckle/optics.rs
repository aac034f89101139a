//! From the projector via the surface into the lens: the image position of every dot, and the 10-bit
//! numbers of the infrared camera.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::causes::{Causes, Moment, WAVELENGTH_NM};
use super::pattern::{Dot, Grain, Pattern};
use crate::camera::Camera;
use crate::effects::fill_normal;
use crate::frame::Frame;
use crate::rng::Stream;
use crate::scene::{Hit, RaysFrom, WHITE, World};

/// A dot in the picture: a Gaussian.
pub struct Spot {
    /// Centre, px.
    pub u: f64,
    pub v: f64,
    /// Peak value, DN.
    pub peak: f64,
    /// Covariance, px^2.
    pub covariance: Matrix2<f64>,
}

/// Projector and camera at one moment.
pub struct Optics<'a> {
    /// The true lens, distortion included.
    pub camera: &'a Camera,
    /// Position of the projector in the camera's frame, m.
    pub projector: Vector3<f64>,
    /// Sines of the diffracted beams relative to those at the factory: proportional to the wavelength.
    pub pattern_scale: f64,
    pub blur_px: f64,
    /// Relative projector power.
    pub light: f64,
}

/// Mean peak of a dot: 5.90e8 cos / r^2 DN (r in mm), 10 bits (Landau, Choo and Beling 2015).
const PEAK_DN_AT_1_M: f64 = 590.0;
/// Their Gamma factor has mean 4.54 * 0.196, not one.
const LANDAU_MEAN: f64 = 4.54 * 0.196;
/// Standard deviation of a dot's beam, camera px: with blur and pixel 0.63 px, FWHM 1.5 px, as in infrared
/// pictures of a Kinect (1 to 2 px).
const BEAM_PX: f64 = 0.4;
/// Averaging over a square pixel of side one: variance of a uniform variable, px^2.
const PIXEL_VARIANCE: f64 = 1.0 / 12.0;
/// Lens blur at which Landau's peak holds, px.
const LANDAU_BLUR_PX: f64 = 0.4;
/// A surface that hides a point is nearer by more than this share of the distance.
const HIDING_SHARE: f64 = 1e-3;

impl<'a> Optics<'a> {
    pub fn at(moment: &Moment, causes: &Causes, camera: &'a Camera, baseline_m: f64) -> Self {
        Optics {
            camera,
            projector: Vector3::x()
                * (baseline_m * (1.0 + causes.expansion_per_k * moment.warmth_k)),
            pattern_scale: 1.0 + causes.wavelength_nm_per_k * moment.warmth_k / WAVELENGTH_NM,
            blur_px: causes.blur_px,
            light: causes.light,
        }
    }

    /// Projects the pattern onto the world, with the speckle of each dot.
    pub fn spots(&self, world: &dyn World, pattern: &Pattern, grains: &[Grain]) -> Vec<Spot> {
        let eyes = [world.from(self.projector), world.from(Vector3::zeros())];
        let lit = pattern.dots.iter().zip(grains);
        lit.filter_map(|(dot, grain)| self.spot(&eyes, dot, grain)).collect()
    }

    /// `eyes` cast rays from the projector and from the camera.
    fn spot(&self, eyes: &[RaysFrom<'_>; 2], dot: &Dot, grain: &Grain) -> Option<Spot> {
        let [projector, camera] = eyes;
        let beam = self.beam(dot)?;
        let hit = projector(&beam)?;
        let point = self.projector + beam * hit.t;
        if !seen_from_camera(camera, &point, &hit) {
            return None;
        }
        let (x, y) = (point.x / point.z, point.y / point.z);
        let shape = self.picture_from_pattern(&beam, &hit, (x, y));
        let beam_sd = BEAM_PX / self.camera.fx;
        let (u, v) = self.camera.project(x, y);
        let aside = shape * Vector2::from(grain.aside) * beam_sd;
        let image = shape * shape.transpose() * (beam_sd * beam_sd);
        let covariance = image + Matrix2::identity() * smear(self.blur_px);
        let irradiance =
            -hit.normal.dot(&beam) / beam.norm() / (hit.t * hit.t * beam.norm_squared());
        // cos^4 of the angle to the axis: smaller aperture, longer path, slanted pixel.
        let vignetting = (1.0 + x * x + y * y).powi(-2);
        let brightness = irradiance * vignetting * hit.albedo / WHITE * dot.energy * grain.light;
        let spread = (image.determinant() / covariance.determinant()).sqrt();
        let peak = full_light() * self.light * brightness * spread;
        Some(Spot { u: u + aside.x, v: v + aside.y, peak, covariance })
    }

    /// Ray of a dot. Diffraction fixes sines, not tangents: they grow with the wavelength.
    fn beam(&self, dot: &Dot) -> Option<Vector3<f64>> {
        let sines = Vector3::new(dot.x, dot.y, 1.0).normalize() * self.pattern_scale;
        let forward = 1.0 - sines.x * sines.x - sines.y * sines.y;
        let tangent = |sine: f64| sine / forward.sqrt();
        (forward > 0.0).then(|| Vector3::new(tangent(sines.x), tangent(sines.y), 1.0))
    }

    /// Jacobian of picture coordinates (px) with respect to pattern coordinates, on the surface that was
    /// hit.
    ///
    /// On a plane 1/z is affine in the pattern's coordinates, and x_camera = x + baseline / z:
    /// a tilt along the baseline stretches the pattern, one across it shears it.
    fn picture_from_pattern(&self, beam: &Vector3<f64>, hit: &Hit, at: (f64, f64)) -> Matrix2<f64> {
        let slope = self.projector.x / (hit.t * hit.normal.dot(beam));
        let camera_from_pattern =
            Matrix2::new(1.0 + slope * hit.normal.x, slope * hit.normal.y, 0.0, 1.0);
        lens_jacobian(self.camera, at) * camera_from_pattern
    }
}

fn smear(blur_px: f64) -> f64 {
    blur_px * blur_px + PIXEL_VARIANCE
}

/// Peak of an unblurred mean dot on white at 1 m, DN, such that the blurred dot has Landau's peak.
fn full_light() -> f64 {
    let beam = BEAM_PX * BEAM_PX;
    PEAK_DN_AT_1_M * LANDAU_MEAN * (beam + smear(LANDAU_BLUR_PX)) / beam
}

/// Whether the lit side faces the camera, with nothing in between.
fn seen_from_camera(camera: &RaysFrom<'_>, point: &Vector3<f64>, hit: &Hit) -> bool {
    hit.normal.dot(point) < 0.0 && camera(point).is_none_or(|first| first.t > 1.0 - HIDING_SHARE)
}

/// Jacobian of pixel coordinates with respect to normalised coordinates at (x, y).
fn lens_jacobian(camera: &Camera, (x, y): (f64, f64)) -> Matrix2<f64> {
    if camera.distortion.is_none() {
        return Matrix2::new(camera.fx, 0.0, 0.0, camera.fy);
    }
    // Distortion varies over tenths; a thousandth is short against that and long against rounding.
    const H: f64 = 1e-3;
    let column = |dx: f64, dy: f64| {
        let (u1, v1) = camera.project(x + dx, y + dy);
        let (u0, v0) = camera.project(x - dx, y - dy);
        ((u1 - u0) / (2.0 * H), (v1 - v0) / (2.0 * H))
    };
    let ((a, c), (b, d)) = (column(H, 0.0), column(0.0, H));
    Matrix2::new(a, b, c, d)
}

/// A picture in DN, before noise; its first column may lie outside the camera's image.
pub struct Picture {
    pub width: usize,
    pub height: usize,
    /// Column of the camera's image at which this picture begins, px.
    pub first_column: i64,
    pub dn: Vec<f32>,
}

/// A Gaussian is cut off where it has fallen to 1/500: below the noise of any single pixel.
const REACH_SIGMA: f64 = 3.5;
/// Longest dot, px: at grazing incidence a dot becomes a streak, and a longer one is too faint to be seen.
const LONGEST_PX: f64 = 20.0;

impl Picture {
    pub fn dark(width: usize, height: usize, first_column: i64) -> Self {
        Picture { width, height, first_column, dn: vec![0.0; width * height] }
    }

    pub fn with(mut self, spots: &[Spot]) -> Self {
        spots.iter().for_each(|spot| self.add(spot));
        self
    }

    fn add(&mut self, spot: &Spot) {
        let c = &spot.covariance;
        let Some(inverse) = c.try_inverse() else { return };
        let (a, b, d) = (-0.5 * inverse[(0, 0)], -inverse[(0, 1)], -0.5 * inverse[(1, 1)]);
        let reach = |variance: f64| (REACH_SIGMA * variance.sqrt()).min(LONGEST_PX);
        let u0 = spot.u - self.first_column as f64;
        let columns = covered(u0, reach(c[(0, 0)]), self.width);
        for v in covered(spot.v, reach(c[(1, 1)]), self.height) {
            let dv = v as f64 - spot.v;
            let row = &mut self.dn[v * self.width..][..self.width];
            for u in columns.clone() {
                let du = u as f64 - u0;
                let exponent = a * du * du + b * du * dv + d * dv * dv;
                row[u] += (spot.peak * exponent.exp()) as f32;
            }
        }
    }
}

/// Pixels within `reach` of `centre`.
fn covered(centre: f64, reach: f64, size: usize) -> std::ops::Range<usize> {
    let low = (centre - reach).ceil().max(0.0);
    let high = (centre + reach).floor().min(size as f64 - 1.0);
    if low <= high { low as usize..high as usize + 1 } else { 0..0 }
}

/// A 10-bit sensor of this class has a full well of some 10,000 electrons.
const ELECTRONS_PER_DN: f32 = 10.0;
const FULL_DN: f32 = 1023.0;
/// Black level: four times the usual read noise, so that unsigned 10 bits clip nothing.
const BLACK_DN: f32 = 42.0;

/// Exposes the chip once, with shot and read noise. `ambient` is the light without the projector, DN,
/// row-major.
pub fn expose(
    picture: &Picture,
    ambient: Option<&[f32]>,
    causes: &Causes,
    rng: &mut Stream,
) -> Frame {
    let mut noise = vec![0f32; picture.dn.len()];
    fill_normal(&mut noise, rng);
    let read = (causes.read_noise_dn * causes.read_noise_dn) as f32;
    let words = picture.dn.iter().zip(&noise).enumerate().map(|(i, (dots, noise))| {
        let light = dots + ambient.map_or(0.0, |dn| dn[i]);
        let sd = (light / ELECTRONS_PER_DN + read).sqrt();
        (BLACK_DN + light + sd * noise).round().clamp(0.0, FULL_DN) as u16
    });
    Frame { width: picture.width, height: picture.height, raw: words.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Centroid, total and covariance of a drawn spot against its parameters.
    #[test]
    fn a_spot_keeps_its_place_light_and_slant() {
        let covariance = Matrix2::new(1.2, 0.4, 0.4, 0.7);
        let spot = Spot { u: 3.3, v: 9.6, peak: 100.0, covariance };
        let picture = Picture::dark(24, 20, -7).with(&[spot]);
        let (mut total, mut u, mut v, mut uv) = (0.0, 0.0, 0.0, 0.0);
        for (i, &dn) in picture.dn.iter().enumerate() {
            let (x, y, dn) = ((i % 24) as f64 - 7.0, (i / 24) as f64, f64::from(dn));
            total += dn;
            u += dn * x;
            v += dn * y;
            uv += dn * (x - 3.3) * (y - 9.6);
        }
        let expected = 100.0 * std::f64::consts::TAU * covariance.determinant().sqrt();
        assert!((total / expected - 1.0).abs() < 0.01, "{total} {expected}");
        assert!((u / total - 3.3).abs() < 0.01 && (v / total - 9.6).abs() < 0.01);
        assert!((uv / total - 0.4).abs() < 0.03, "{}", uv / total);
    }
}
