//! What there is to see: surfaces in front of a camera, and what every pixel sees of them.
//!
//! Optical frame of the camera: x right, y down, z forward, metres.

mod bench;
mod seen;

pub use bench::{Bench, Board, PATCH_SIDE_M, Patch, Print, Target, WHITE};
pub use seen::{Nothing, Seen, Surface};

use nalgebra::Vector3;

use crate::plane::Plane;

/// Surfaces that light can meet.
pub trait World: Sync {
    /// The nearest surface along `origin + t * direction`, t > 0 (t in units of `direction`).
    fn cast(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit>;

    /// The surfaces [`Hit::surface`] numbers.
    fn surfaces(&self) -> Vec<Surface>;

    /// The calibration target's own coordinates, where there is one.
    fn target(&self) -> Option<TargetFrame> {
        None
    }
}

/// Coordinates on a flat target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetFrame {
    /// Where they begin, m.
    pub centre: Vector3<f64>,
    /// Unit vectors along the target: to its right, and down.
    pub right: Vector3<f64>,
    pub down: Vector3<f64>,
}

impl TargetFrame {
    /// On a plane, its right as near to the image's horizontal as the tilt allows.
    pub fn on(plane: &Plane, centre: Vector3<f64>) -> Self {
        let normal = plane.normal().into_inner();
        let right = Vector3::y().cross(&normal).normalize();
        TargetFrame { centre, right, down: normal.cross(&right) }
    }

    /// Of a point, m: right and down of the centre.
    pub fn place(&self, point: &Vector3<f64>) -> (f64, f64) {
        let offset = point - self.centre;
        (offset.dot(&self.right), offset.dot(&self.down))
    }
}

/// Where a ray ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub t: f64,
    /// Unit normal on the side the ray came from.
    pub normal: Vector3<f64>,
    /// Index into [`World::surfaces`].
    pub surface: u16,
    /// Share of infrared light given back, 0 to 1.
    pub albedo: f64,
}
