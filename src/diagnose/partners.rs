//! Which simulated view belongs to which real one: by name, else by pose.

use std::f64::consts::TAU;

use super::field::Field;

/// Where a view's plane is.
#[derive(Debug, Clone)]
pub struct Pose {
    name: String,
    z_m: f64,
    theta_rad: f64,
    azimuth_rad: f64,
}

/// Poses farther apart are different ones: a share of the distance, tilt, direction of the tilt.
const Z_SHARE: f64 = 0.1;
const THETA_RAD: f64 = 8.0 * TAU / 360.0;
const AZIMUTH_RAD: f64 = 30.0 * TAU / 360.0;
/// Below this tilt a plane has no direction.
const TILTED_RAD: f64 = 10.0 * TAU / 360.0;

impl Pose {
    pub fn of(field: &Field) -> Self {
        Pose {
            name: field.name.clone(),
            z_m: field.plane.depth(0.0, 0.0),
            theta_rad: field.plane.theta(),
            azimuth_rad: field.plane.azimuth(),
        }
    }

    /// In tolerances; `None` where one is exceeded.
    fn off(&self, other: &Pose) -> Option<f64> {
        let z = (other.z_m - self.z_m).abs() / (Z_SHARE * self.z_m);
        let theta = (other.theta_rad - self.theta_rad).abs() / THETA_RAD;
        let turned = (other.azimuth_rad - self.azimuth_rad).rem_euclid(TAU);
        let tilted = self.theta_rad.max(other.theta_rad) > TILTED_RAD;
        let azimuth = if tilted { turned.min(TAU - turned) / AZIMUTH_RAD } else { 0.0 };
        (z.max(theta).max(azimuth) <= 1.0).then_some(z + theta + azimuth)
    }
}

/// For each real view the number of its simulated one; none serves twice. A name alone is not
/// enough: numbered views of two recordings have the same names.
pub fn partners(real: &[Pose], simulated: &[Pose]) -> Vec<Option<usize>> {
    let mut pairs: Vec<(bool, f64, usize, usize)> = Vec::new();
    for (i, r) in real.iter().enumerate() {
        for (j, s) in simulated.iter().enumerate() {
            if let Some(off) = r.off(s) {
                pairs.push((r.name != s.name, off, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then((a.2, a.3).cmp(&(b.2, b.3))));
    let mut found = vec![None; real.len()];
    let mut taken = vec![false; simulated.len()];
    for (_, _, i, j) in pairs {
        if found[i].is_none() && !taken[j] {
            (found[i], taken[j]) = (Some(j), true);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(name: &str, z_m: f64, theta_deg: f64, azimuth_deg: f64) -> Pose {
        let (theta_rad, azimuth_rad) = (theta_deg.to_radians(), azimuth_deg.to_radians());
        Pose { name: name.into(), z_m, theta_rad, azimuth_rad }
    }

    #[test]
    fn names_come_first_then_poses_and_none_serves_twice() {
        let real = [
            pose("a", 1.0, 30.0, 179.0),
            pose("b", 1.0, 2.0, 90.0),
            pose("c", 2.0, 0.0, 0.0),
            pose("d", 2.0, 40.0, 0.0),
        ];
        let simulated = [
            pose("c", 2.1, 0.0, 0.0),
            // The name of a, the pose of another.
            pose("a", 3.0, 30.0, 179.0),
            pose("x", 1.02, 33.0, -175.0),
            pose("y", 0.97, 1.0, 0.0),
            pose("z", 0.98, 1.0, 0.0),
        ];
        let found = partners(&real, &simulated);
        assert_eq!(found, [Some(2), Some(4), Some(0), None]);
    }
}
