//! What a [`NoiseModel`] says of the points of a depth image.

use nalgebra::Vector3;

use crate::model::{NoiseModel, SigmaLookup};

/// Sigma over depth and tilt, looked up, and how many neighbours err as one.
#[derive(Debug, Clone)]
pub struct Noise {
    table: SigmaLookup,
    /// The greatest depth that the model was measured at, m.
    max_depth_m: f32,
    /// Pixels that err together: the area of the window that neighbours share, px^2.
    correlated_px2: f32,
}

/// The effect of the catalogue that says how far neighbours err together, and its parameter.
const CORRELATION: (&str, &str) = ("spatial-correlation", "length_px");

impl Noise {
    pub fn of(model: &NoiseModel) -> Self {
        let length = |entry: &crate::model::Effect| {
            let value = entry.parameters.get(CORRELATION.1)?;
            let number = value.as_f64().or_else(|| value.get("value")?.as_f64());
            number.filter(|l| l.is_finite() && *l > 1.0)
        };
        let entry = model.effects.iter().find(|e| e.id == CORRELATION.0);
        let length = entry.and_then(length).unwrap_or(1.0) as f32;
        Noise {
            table: SigmaLookup::of(&model.sigma),
            max_depth_m: model.sigma.domain.z_m[1] as f32,
            correlated_px2: length * length,
        }
    }

    /// Standard deviation of a depth `z`, m, on a surface with this normal.
    ///
    /// Beyond the depths of the model sigma grows as z^2, as it does for every sensor that measures
    /// disparity: held at its edge it would make the farthest points the best.
    pub fn sigma_axial(&self, z: f32, normal: &Vector3<f32>) -> f32 {
        self.at(z, normal.z.abs().min(1.0).acos())
    }

    /// The same of a surface that is faced squarely.
    pub fn sigma_frontal(&self, z: f32) -> f32 {
        self.at(z, 0.0)
    }

    fn at(&self, z: f32, theta: f32) -> f32 {
        let beyond = (z / self.max_depth_m).max(1.0);
        self.table.at(z, theta) * beyond * beyond
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
        let part = (at.dot(normal) / at.z).abs();
        sigma_axial * part / (n / self.correlated_px2).max(1.0).sqrt()
    }
}
