//! The scene: surfaces that light can hit, and what every camera pixel sees of them, computed once per
//! view.
//!
//! Optical frame of the camera: x right, y down, z forward, metres.

mod bench;

pub use bench::{Bench, Board, PATCH_SIDE_M, Patch, Print, Target, WHITE};

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::camera::{Camera, Rays};
use crate::plane::Plane;

/// Finds the nearest surface along a direction from a fixed origin.
pub type RaysFrom<'a> = Box<dyn Fn(&Vector3<f64>) -> Option<Hit> + 'a>;

/// Surfaces that light can hit.
pub trait World: Sync {
    /// The nearest surface along `origin + t * direction`, t > 0 (t in units of `direction`).
    fn cast(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit>;

    /// Like [`World::cast`], for many rays from one origin.
    fn from<'a>(&'a self, origin: Vector3<f64>) -> RaysFrom<'a> {
        Box::new(move |direction| self.cast(&origin, direction))
    }

    /// The surfaces that [`Hit::surface`] indexes.
    fn surfaces(&self) -> Vec<Surface>;

    /// Coordinate frame of the calibration target, if there is one.
    fn target(&self) -> Option<TargetFrame> {
        None
    }
}

/// Coordinates on a flat target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetFrame {
    /// Origin, m.
    pub centre: Vector3<f64>,
    /// Unit vectors along the target: to its right, and down.
    pub right: Vector3<f64>,
    pub down: Vector3<f64>,
}

impl TargetFrame {
    /// Frame on a plane, its right as near to the image's horizontal as the tilt allows.
    pub fn on(plane: &Plane, centre: Vector3<f64>) -> Self {
        let normal = plane.normal().into_inner();
        let right = Vector3::y().cross(&normal).normalize();
        TargetFrame { centre, right, down: normal.cross(&right) }
    }

    /// The same turned in its plane by this angle, from its right towards its down.
    pub fn turned(self, angle_rad: f64) -> Self {
        let (sin, cos) = angle_rad.sin_cos();
        let right = cos * self.right + sin * self.down;
        TargetFrame { right, down: cos * self.down - sin * self.right, ..self }
    }

    /// Coordinates of a point, m: right and down of the centre.
    pub fn place(&self, point: &Vector3<f64>) -> (f64, f64) {
        let offset = point - self.centre;
        (offset.dot(&self.right), offset.dot(&self.down))
    }
}

/// Where a ray hits a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub t: f64,
    /// Unit normal on the side the ray came from.
    pub normal: Vector3<f64>,
    /// Index into [`World::surfaces`].
    pub surface: u16,
    /// Infrared reflectance, 0 to 1.
    pub albedo: f64,
}

/// One connected piece of the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Whether it belongs to the calibration target.
    pub is_target: bool,
    /// Tilt against the optical axis, rad, where it is constant; otherwise `None`.
    pub theta_rad: Option<f64>,
}

/// What a camera sees, per pixel, row-major.
#[derive(Debug, Clone)]
pub struct Seen {
    pub width: usize,
    pub height: usize,
    /// Depth along the optical axis, m; NaN where there is nothing.
    pub depth: Vec<f32>,
    /// Unit normal towards the camera.
    pub normal: Vec<[f32; 3]>,
    /// Index into `surfaces`; [`Seen::NOTHING`] where nothing is hit.
    pub surface: Vec<u16>,
    /// Infrared reflectance.
    pub albedo: Vec<f32>,
    pub surfaces: Vec<Surface>,
    pub target: Option<TargetFrame>,
}

impl Seen {
    pub const NOTHING: u16 = u16::MAX;

    /// Casts the rays of all pixels from the camera's centre.
    pub fn of(world: &dyn World, camera: &Camera, rays: &Rays) -> Self {
        let hits: Vec<_> = (0..camera.pixels())
            .into_par_iter()
            .map(|i| {
                let (x, y) = rays.at(i);
                world.cast(&Vector3::zeros(), &Vector3::new(x, y, 1.0))
            })
            .collect();
        let mut seen = Seen {
            width: camera.width,
            height: camera.height,
            depth: Vec::with_capacity(hits.len()),
            normal: Vec::with_capacity(hits.len()),
            surface: Vec::with_capacity(hits.len()),
            albedo: Vec::with_capacity(hits.len()),
            surfaces: world.surfaces(),
            target: world.target(),
        };
        for hit in hits {
            // The ray's third component is one: its parameter is the depth.
            seen.depth.push(hit.map_or(f32::NAN, |h| h.t as f32));
            seen.normal.push(hit.map_or([0.0; 3], |h| h.normal.cast::<f32>().into()));
            seen.surface.push(hit.map_or(Self::NOTHING, |h| h.surface));
            seen.albedo.push(hit.map_or(0.0, |h| h.albedo as f32));
        }
        seen
    }

    fn surface_at(&self, i: usize) -> Option<&Surface> {
        self.surfaces.get(usize::from(self.surface[i]))
    }

    pub fn is_target(&self, i: usize) -> bool {
        self.surface_at(i).is_some_and(|s| s.is_target)
    }

    /// Tilt of the surface at pixel `i` against the optical axis, rad.
    pub fn theta(&self, i: usize) -> f64 {
        let flat = self.surface_at(i).and_then(|s| s.theta_rad);
        flat.unwrap_or_else(|| f64::from(self.normal[i][2].abs().min(1.0)).acos())
    }

    /// Image direction in which the surface at pixel `i` recedes, rad, 0 along the columns.
    ///
    /// The normal towards the camera leans to the side on which the depth grows.
    pub fn azimuth(&self, i: usize) -> f64 {
        let [x, y, _] = self.normal[i];
        f64::from(y).atan2(f64::from(x))
    }

    /// Cosine between the pixel's line of sight and the normal.
    pub fn cos_incidence(&self, i: usize, rays: &Rays) -> f64 {
        let (x, y) = rays.at(i);
        let [a, b, c] = self.normal[i].map(f64::from);
        ((a * x + b * y + c) / (x * x + y * y + 1.0).sqrt()).abs()
    }
}
