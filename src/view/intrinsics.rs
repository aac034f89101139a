//! Uncertainties of a camera's intrinsics.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::units::shortest;

/// Standard uncertainties (k = 1) of the intrinsics, px; what is not stated is left out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(expecting = "an object with any of fx, fy, cx and cy")]
pub struct IntrinsicsUncertainty {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fx: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fy: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cx: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cy: Option<f64>,
}

impl IntrinsicsUncertainty {
    /// Relative uncertainties of fx and fy, 0 for one that is not stated; `None` if neither is.
    pub fn focal_relative(&self, camera: &Camera) -> Option<[f64; 2]> {
        let relative = [self.fx.map(|u| u / camera.fx), self.fy.map(|u| u / camera.fy)];
        relative.iter().any(Option::is_some).then(|| relative.map(|u| u.unwrap_or(0.0)))
    }

    /// Uncertainty of the principal point as angles, rad, 0 for one that is not stated; `None` if neither is.
    pub fn axis_rad(&self, camera: &Camera) -> Option<[f64; 2]> {
        let angles = [self.cx.map(|u| u / camera.fx), self.cy.map(|u| u / camera.fy)];
        angles.iter().any(Option::is_some).then(|| angles.map(|u| u.unwrap_or(0.0)))
    }

    pub(super) fn fault(&self, camera: &Camera) -> Option<String> {
        // An uncertainty as large as the value (cx, cy: as the image) is meaningless: the unit is wrong.
        let (width, height) = (camera.width as f64, camera.height as f64);
        let stated = [
            ("fx", self.fx, camera.fx),
            ("fy", self.fy, camera.fy),
            ("cx", self.cx, width),
            ("cy", self.cy, height),
        ];
        stated.into_iter().find_map(|(key, u, below)| {
            let u = u.filter(|u| !(*u > 0.0 && *u < below))?;
            let (u, below) = (shortest(u), shortest(below));
            Some(format!(
                "intrinsics_uncertainty.{key} = {u} must be a standard uncertainty in px, above 0 and below {below}"
            ))
        })
    }
}
