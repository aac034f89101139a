//! Recordings that no sensor took: by formula, by speckle, or as a film of a room.
//!
//! A [`Shoot`] is a list of [`ViewPlan`]s and a sensor. Its physics is sigma(z, theta) with the
//! effects of the catalogue ([`FormulaSensor`]), or a Kinect of dots and a matcher in which errors
//! arise by themselves ([`speckle`]). Output is written in the recording layout and read back by the
//! same reader as real data; nothing in it says what was switched on.

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

/// Distances times tilts; the tilt's direction alternates between the image's two axes.
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

/// Eq. 1 has its pole at 79.6 degrees; here sigma is still finite and the tilt term already shows.
const STEEPEST_DEG: f64 = 76.0;

impl Grid {
    /// The paper's: 1 to 4 m by 0.5 m, 0 to 80 degrees by 10, but 76 for 80, beyond Eq. 1's pole.
    pub fn paper() -> Self {
        let tilts = (0..8).map(|i| f64::from(10 * i)).chain([STEEPEST_DEG]);
        Grid {
            distances_m: (0..7).map(|i| 1.0 + 0.5 * f64::from(i)).collect(),
            tilts_rad: tilts.map(f64::to_radians).collect(),
        }
    }

    /// Every distance and tilt in each of these directions, rad; a tilt of zero has none.
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
