//! Which poses to shoot.

use crate::plane::Plane;

/// Distances times tilts; the tilt's direction alternates between the image's two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    pub distances_m: Vec<f64>,
    pub tilts_rad: Vec<f64>,
}

/// One pose of the board.
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

/// Eq. 1 has its pole at 79.6 degrees; the last view stands where sigma is still finite and the
/// tilt term already shows.
const STEEPEST_DEG: f64 = 76.0;

impl Grid {
    /// The paper's: 1 to 4 m by 0.5 m, 0 to 80 degrees by 10; 76 stands in for 80, where Eq. 1 is
    /// beyond its pole.
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
                let quarter_turns = (i + j) % 4;
                let azimuth_rad = std::f64::consts::FRAC_PI_2 * quarter_turns as f64;
                views.push(GridView { z_m, theta_rad, azimuth_rad });
            }
        }
        views
    }
}
