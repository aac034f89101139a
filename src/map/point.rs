//! Surface points, their standard deviations by a [`NoiseModel`], and a fast rigid motion for many points.

use nalgebra::{Isometry3, Vector3};

use crate::model::{NoiseModel, SigmaLookup};

/// A point of a depth image, or the mean of several, with its surface normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// m, optical frame.
    pub at: Vector3<f32>,
    /// Unit length, towards the camera.
    pub normal: Vector3<f32>,
    /// sigma(z, theta) of a single measurement along the optical axis, m.
    pub sigma_axial: f32,
    /// Standard deviation of this (averaged) point along its normal, m.
    pub sigma_normal: f32,
    /// Index of a representative pixel, row-major.
    pub pixel: u32,
}

/// A rigid motion for many points, in single precision and written out so that it is inlined.
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

    /// Rotates a direction.
    #[inline]
    pub fn turned(&self, v: &Vector3<f32>) -> Vector3<f32> {
        let [a, b, c] = &self.rows;
        let dot = |r: &[f32; 3]| r[0] * v.x + r[1] * v.y + r[2] * v.z;
        Vector3::new(dot(a), dot(b), dot(c))
    }

    /// Moves a position.
    #[inline]
    pub fn moved(&self, p: &Vector3<f32>) -> Vector3<f32> {
        let v = self.turned(p);
        Vector3::new(v.x + self.shift[0], v.y + self.shift[1], v.z + self.shift[2])
    }
}

/// Look-up table of sigma over depth and tilt, with the correlation of neighbours.
pub struct Noise {
    table: SigmaLookup,
    /// The largest depth at which the model was measured, m.
    max_depth_m: f32,
    /// Pixels per independent sample: the area of the window that neighbours share, px^2.
    correlated_px2: f32,
}

/// Least share of a depth error that moves a point along its normal: the normal, from the few pixels
/// around, is not known to a degree. Without this floor a point on a surface seen edge-on would be certain.
const MIN_PART: f32 = 0.02;

/// The catalogue effect that gives the correlation length of neighbours, its parameter, and the share of
/// the variance that is correlated (all of it if not given).
const CORRELATION: [&str; 3] = ["spatial-correlation", "length_px", "share"];

impl Noise {
    pub fn of(model: &NoiseModel) -> Self {
        let entry = model.effects.iter().find(|e| e.id == CORRELATION[0]);
        let number = |name: &str| entry?.number(name).filter(|n| n.is_finite());
        let length = number(CORRELATION[1]).unwrap_or(1.0).max(1.0);
        let share = number(CORRELATION[2]).unwrap_or(1.0).clamp(0.0, 1.0);
        Noise {
            table: SigmaLookup::of(&model.sigma),
            max_depth_m: model.sigma.domain.z_m[1] as f32,
            correlated_px2: (1.0 + share * (length * length - 1.0)) as f32,
        }
    }

    /// Standard deviation of a depth `z`, m, on a surface with this normal.
    ///
    /// Beyond the model's depths sigma grows as z^2, as for every sensor that measures disparity; held at its
    /// edge value it would make the farthest points the best.
    pub fn sigma_axial(&self, z: f32, normal: &Vector3<f32>) -> f32 {
        self.grown(z, self.table.at(z, normal.z.abs().min(1.0).acos()))
    }

    /// As [`Noise::sigma_axial`], at normal incidence.
    pub fn sigma_facing(&self, z: f32) -> f32 {
        self.grown(z, self.table.at(z, 0.0))
    }

    #[inline]
    fn grown(&self, z: f32, sigma: f32) -> f32 {
        let beyond = (z / self.max_depth_m).max(1.0);
        sigma * beyond * beyond
    }

    /// Sigma along the normal, m, of the mean of `n` pixels: a depth error moves a point along its ray, and
    /// only the component along the normal counts.
    pub fn sigma_normal(
        &self,
        sigma_axial: f32,
        at: &Vector3<f32>,
        normal: &Vector3<f32>,
        n: f32,
    ) -> f32 {
        let part = (at.dot(normal) / at.z).abs().max(MIN_PART);
        sigma_axial * part / (n / self.correlated_px2).max(1.0).sqrt()
    }
}
