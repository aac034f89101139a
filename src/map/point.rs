//! A measured piece of surface, its standard deviations as a [`NoiseModel`] says, and a pose that
//! moves many of them.

use nalgebra::{Isometry3, Vector3};

use crate::model::{NoiseModel, SigmaLookup};

/// A point of a depth image, or the mean of some, with its surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// m, optical frame.
    pub at: Vector3<f32>,
    /// Unit length, towards the camera.
    pub normal: Vector3<f32>,
    /// sigma(z, theta) of one measurement along the optical axis, m.
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

/// Sigma over depth and tilt, looked up, and how many neighbours err as one.
pub struct Noise {
    table: SigmaLookup,
    /// The greatest depth that the model was measured at, m.
    max_depth_m: f32,
    /// Pixels that err together: the area of the window that neighbours share, px^2.
    correlated_px2: f32,
}

/// The least share of an error of depth that moves a point along its normal: the normal itself, of the
/// few pixels around, is not known to a degree. Of a surface seen edge on nothing would be left, and
/// the point would be certain.
const MIN_PART: f32 = 0.02;

/// The effect of the catalogue that says how far neighbours err together, its parameter, and the
/// share of the variance that does; all where it is not told.
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
    /// Beyond the depths of the model sigma grows as z^2, as it does for every sensor that measures
    /// disparity: held at its edge it would make the farthest points the best.
    pub fn sigma_axial(&self, z: f32, normal: &Vector3<f32>) -> f32 {
        self.grown(z, self.table.at(z, normal.z.abs().min(1.0).acos()))
    }

    /// The same of a surface that is faced squarely.
    pub fn sigma_facing(&self, z: f32) -> f32 {
        self.grown(z, self.table.at(z, 0.0))
    }

    #[inline]
    fn grown(&self, z: f32, sigma: f32) -> f32 {
        let beyond = (z / self.max_depth_m).max(1.0);
        sigma * beyond * beyond
    }

    /// Sigma, m, of the mean of `n` pixels along their normal: an error of depth moves a point along
    /// its ray, and of that the normal's part counts.
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
