//! A measured piece of surface with its standard deviations, and a pose that moves many of them.

use nalgebra::{Isometry3, Vector3};

/// A point of a depth image, or the mean of some, with its surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// m, optical frame.
    pub at: Vector3<f32>,
    /// Unit length, towards the camera.
    pub normal: Vector3<f32>,
    /// sigma(z, theta) of one measurement along the optical axis, m: the paper's weight is its
    /// inverse.
    pub sigma_axial: f32,
    /// Standard deviation of this point, averaged as it is, along its normal, m.
    pub sigma_normal: f32,
    /// The pixel that stands for it, row-major.
    pub pixel: u32,
}

/// A pose for many points: plain single-precision arithmetic, written out so that it is inlined.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    rows: [[f32; 3]; 3],
    /// m.
    shift: [f32; 3],
}

impl Motion {
    pub fn of(pose: &Isometry3<f64>) -> Self {
        let turn = pose.rotation.to_rotation_matrix();
        let m = turn.matrix();
        Motion {
            rows: [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)] as f32)),
            shift: [0, 1, 2].map(|i| pose.translation.vector[i] as f32),
        }
    }

    /// Of a direction.
    #[inline]
    pub fn turned(&self, v: &Vector3<f32>) -> Vector3<f32> {
        let [a, b, c] = &self.rows;
        let dot = |r: &[f32; 3]| r[0] * v.x + r[1] * v.y + r[2] * v.z;
        Vector3::new(dot(a), dot(b), dot(c))
    }

    /// Of a place.
    #[inline]
    pub fn moved(&self, p: &Vector3<f32>) -> Vector3<f32> {
        let v = self.turned(p);
        Vector3::new(v.x + self.shift[0], v.y + self.shift[1], v.z + self.shift[2])
    }
}
