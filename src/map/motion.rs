//! A pose for many points: plain single-precision arithmetic, written out so that it is inlined.

use nalgebra::{Isometry3, Vector3};

/// Rotation, row by row, and shift, m.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    rows: [[f32; 3]; 3],
    shift: [f32; 3],
}

impl Motion {
    pub fn of(pose: &Isometry3<f64>) -> Self {
        let turn = pose.rotation.to_rotation_matrix();
        let m = turn.matrix();
        let row = |i: usize| [0, 1, 2].map(|j| m[(i, j)] as f32);
        Motion {
            rows: [row(0), row(1), row(2)],
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
