//! A measured piece of surface, and how sure it is.

use nalgebra::Vector3;

/// A point of a depth image, or the mean of some, with its surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// m, optical frame.
    pub at: Vector3<f32>,
    /// Unit length, towards the camera.
    pub normal: Vector3<f32>,
    /// sigma(z, theta) of one measurement along the optical axis, m: the paper's weight is its
    /// inverse.
    pub axial: f32,
    /// Standard deviation of this point, averaged as it is, across its surface, m.
    pub across: f32,
    /// The pixel that stands for it, row-major.
    pub pixel: u32,
}
