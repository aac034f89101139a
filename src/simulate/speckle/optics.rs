//! From the projector to the surface and into the lens: where every dot lands in the picture, at the
//! temperature and with the motion of the instant.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::causes::Causes;
use super::pattern::{Dot, Grain, Pattern};
use crate::camera::Camera;
use crate::effects::Instant;
use crate::plane::Plane;
use crate::scene::{Bench, Hit, WHITE, World};

/// A dot in the picture: a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Centre, px.
    pub u: f64,
    pub v: f64,
    /// Brightest value, DN.
    pub peak: f64,
    /// Covariance, px^2.
    pub covariance: Matrix2<f64>,
}

/// Projector and camera as they stand at one moment.
pub struct Optics<'a> {
    /// The true lens, distortion included.
    pub camera: &'a Camera,
    /// Of the projector in the camera's frame, m.
    pub projector: Vector3<f64>,
    /// Sines of the diffracted beams over those at the factory: proportional to the wavelength.
    pub pattern_scale: f64,
    pub blur_px: f64,
    /// Relative projector power.
    pub light: f64,
}

/// Landau, Choo and Beling 2015: 5.90e8 cos / r^2 DN (r in mm) is a dot's mean peak in a 10-bit
/// picture.
const PEAK_DN_AT_1_M: f64 = 590.0;
/// Their Gamma factor has the mean 4.54 * 0.196 and not one.
const LANDAU_MEAN: f64 = 4.54 * 0.196;
/// Beam of a dot, sd in camera px: with blur and pixel 0.63 px, FWHM 1.5 px, as infrared pictures
/// of a Kinect show them (1 to 2 px).
const BEAM_PX: f64 = 0.4;
/// A square pixel of side one averages: variance of a uniform variable.
const PIXEL_VARIANCE: f64 = 1.0 / 12.0;
/// Lens sharpness at which Landau's peak is met, px.
const LANDAU_BLUR_PX: f64 = 0.4;
/// A surface that hides a point is nearer by more than this share of the way.
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

    /// The pattern on the world, with the speckle of each dot.
    pub fn spots(&self, world: &dyn World, pattern: &Pattern, grains: &[Grain]) -> Vec<Spot> {
        let lit = pattern.dots.iter().zip(grains);
        lit.filter_map(|(dot, grain)| self.spot(world, dot, grain)).collect()
    }

    fn spot(&self, world: &dyn World, dot: &Dot, grain: &Grain) -> Option<Spot> {
        let beam = self.beam(dot)?;
        let hit = world.cast(&self.projector, &beam)?;
        let point = self.projector + beam * hit.t;
        if !seen_from_camera(world, &point, &hit) {
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
        // cos^4 of the angle to the axis: less aperture, longer way, slanted pixel.
        let vignetting = (1.0 + x * x + y * y).powi(-2);
        let brightness = irradiance * vignetting * hit.albedo / WHITE * dot.energy * grain.light;
        let spread = (image.determinant() / covariance.determinant()).sqrt();
        let peak = full_light() * self.light * brightness * spread;
        Some(Spot { u: u + aside.x, v: v + aside.y, peak, covariance })
    }

    /// Diffraction fixes sines, not tangents: they grow with the wavelength.
    fn beam(&self, dot: &Dot) -> Option<Vector3<f64>> {
        let sines = Vector3::new(dot.x, dot.y, 1.0).normalize() * self.pattern_scale;
        let forward = 1.0 - sines.x * sines.x - sines.y * sines.y;
        let tangent = |sine: f64| sine / forward.sqrt();
        (forward > 0.0).then(|| Vector3::new(tangent(sines.x), tangent(sines.y), 1.0))
    }

    /// Jacobian of picture coordinates (px) by pattern coordinates, on the surface that was hit.
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

/// Peak of an unblurred mean dot on a white surface at 1 m, DN: so that the blurred one has
/// Landau's.
fn full_light() -> f64 {
    let beam = BEAM_PX * BEAM_PX;
    PEAK_DN_AT_1_M * LANDAU_MEAN * (beam + smear(LANDAU_BLUR_PX)) / beam
}

/// Is the lit side turned to the camera, with nothing in between?
fn seen_from_camera(world: &dyn World, point: &Vector3<f64>, hit: &Hit) -> bool {
    hit.normal.dot(point) < 0.0
        && world.cast(&Vector3::zeros(), point).is_none_or(|first| first.t > 1.0 - HIDING_SHARE)
}

/// Pixels by normalised coordinates at (x, y).
fn lens_jacobian(camera: &Camera, (x, y): (f64, f64)) -> Matrix2<f64> {
    if camera.distortion.is_none() {
        return Matrix2::new(camera.fx, 0.0, 0.0, camera.fy);
    }
    // The lens bends over tenths; a thousandth is short against that and long against rounding.
    const H: f64 = 1e-3;
    let column = |dx: f64, dy: f64| {
        let (u1, v1) = camera.project(x + dx, y + dy);
        let (u0, v0) = camera.project(x - dx, y - dy);
        ((u1 - u0) / (2.0 * H), (v1 - v0) / (2.0 * H))
    };
    let ((a, c), (b, d)) = (column(H, 0.0), column(0.0, H));
    Matrix2::new(a, b, c, d)
}

/// What changes from frame to frame beside the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Above the temperature at which the reference was recorded, K.
    pub warmth_k: f64,
    /// How far the target has moved away since the view began, m.
    pub moved_m: f64,
}

/// Of a Kinect v1's laser, nm.
const WAVELENGTH_NM: f64 = 830.0;
/// A surface that has moved by about a millimetre shows new speckle.
const SPECKLE_LENGTH_M: f64 = 1e-3;

impl Moment {
    /// At the factory, when the reference was recorded.
    pub const FACTORY: Moment = Moment { warmth_k: 0.0, moved_m: 0.0 };

    pub fn of(causes: &Causes, instant: &Instant) -> Self {
        let share = -(-instant.session_s / causes.warm_up_s).exp_m1();
        Moment { warmth_k: causes.warm_up_k * share, moved_m: causes.motion_mps * instant.view_s }
    }

    /// Counts the speckle patterns of a view: the same while the target stands.
    pub fn speckle_epoch(&self) -> i64 {
        (self.moved_m / SPECKLE_LENGTH_M).floor() as i64
    }

    /// The bench as it stands now: the target bowed, and moved along the optical axis.
    pub fn bench(&self, causes: &Causes, at_rest: &Bench) -> Bench {
        let by = Vector3::z() * self.moved_m;
        let normal = at_rest.plane.normal();
        let mut bench = at_rest.clone();
        bench.sagitta_m += causes.bow_m;
        bench.plane =
            Plane::from_normal(normal.into_inner(), at_rest.plane.distance() + normal.dot(&by));
        bench.frame.centre += by;
        bench
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Target;

    #[test]
    fn a_moving_target_is_where_its_speed_takes_it() {
        let bench = Bench::bare(Plane::tilted(2.0, 0.7, 0.3), Target::Wall);
        let causes = Causes::default().with("motion_mps", -0.5).unwrap();
        let instant = Instant { view: 0, frame: 3, session_s: 0.1, view_s: 0.1 };
        let moment = Moment::of(&causes, &instant);
        let moved = moment.bench(&causes, &bench);
        assert!((moved.plane.depth(0.0, 0.0) - 1.95).abs() < 1e-12);
        assert!((moved.plane.theta() - 0.7).abs() < 1e-12);
        assert_ne!(moment.speckle_epoch(), Moment::FACTORY.speckle_epoch());
    }
}
