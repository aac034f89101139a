//! Simulated recordings: by formula, by speckle, or as a film of a room.
//!
//! A [`Shoot`] is a list of [`ViewPlan`]s and a sensor. Its physics is either sigma(z, theta) with the
//! effects of the catalogue ([`FormulaSensor`]), or a Kinect with projected dots and a matcher, in which
//! the errors arise by themselves ([`speckle`]). The output has the recording layout and is read by the
//! same reader as real data; it does not reveal what was switched on.

mod formula;
mod plan;
pub mod room;
mod shoot;
pub mod speckle;

pub use formula::{FormulaSensor, Shooting, Shot, shoot};
pub use plan::{Scenery, ViewPlan, plan_grid, plan_like, plan_on};
pub use shoot::{Physics, Shoot};

use crate::camera::Camera;
use crate::frame::DepthCode;
use crate::plane::Plane;
use crate::view::Sensor;

/// A Kinect v1 in normal mode, its image `shrink` times smaller each way (1 = 640 x 480).
pub fn kinect_v1(shrink: usize) -> Sensor {
    let shrink = shrink.max(1);
    Sensor {
        name: "simulated Kinect v1".into(),
        serial: None,
        mode: Some("normal".into()),
        // 580 px: the focal length OpenNI and ROS give a Kinect v1's infrared camera.
        camera: Camera::centred(640 / shrink, 480 / shrink, 580.0 / shrink as f64),
        baseline_m: Some(0.075),
        code: DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 },
        intrinsics_uncertainty: None,
        kind: None,
    }
}

/// Frame rate of every sensor of this kind, Hz.
pub const RATE_HZ: f64 = 30.0;

/// Every distance with every tilt; the tilt direction alternates between the image's two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    pub distances_m: Vec<f64>,
    pub tilts_rad: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridView {
    /// Depth on the optical axis, m.
    pub z_m: f64,
    pub theta_rad: f64,
    pub azimuth_rad: f64,
}

impl GridView {
    pub fn plane(&self) -> Plane {
        Plane::tilted(self.z_m, self.theta_rad, self.azimuth_rad)
    }
}

/// Steepest tilt: below the pole of Eq. 1 at 79.6 degrees, so sigma is still finite and the tilt term
/// shows.
const STEEPEST_DEG: f64 = 76.0;

impl Grid {
    /// The paper's grid: 1 to 4 m in steps of 0.5 m, 0 to 80 degrees in steps of 10. 76 replaces 80
    /// degrees, which lies beyond the pole of Eq. 1.
    pub fn paper() -> Self {
        let tilts = (0..8).map(|i| f64::from(10 * i)).chain([STEEPEST_DEG]);
        Grid {
            distances_m: (0..7).map(|i| 1.0 + 0.5 * f64::from(i)).collect(),
            tilts_rad: tilts.map(f64::to_radians).collect(),
        }
    }

    /// Every distance and tilt in each of these directions, rad; a tilt of zero occurs once per distance.
    pub fn views_towards(&self, azimuths_rad: &[f64]) -> Vec<GridView> {
        let mut views = Vec::new();
        for &z_m in &self.distances_m {
            for &theta_rad in &self.tilts_rad {
                let directions = if theta_rad == 0.0 { &azimuths_rad[..1] } else { azimuths_rad };
                let pose = |&azimuth_rad| GridView { z_m, theta_rad, azimuth_rad };
                views.extend(directions.iter().map(pose));
            }
        }
        views
    }

    pub fn views(&self) -> Vec<GridView> {
        let mut views = Vec::new();
        for (i, &z_m) in self.distances_m.iter().enumerate() {
            for (j, &theta_rad) in self.tilts_rad.iter().enumerate() {
                let azimuth_rad = std::f64::consts::FRAC_PI_2 * ((i + j) % 4) as f64;
                views.push(GridView { z_m, theta_rad, azimuth_rad });
            }
        }
        views
    }
}
