//! Rolling-shutter correction. The rows of a depth image are exposed one after the other while the camera
//! moves; each point is moved to where the camera would have seen it at the time of the middle row (after
//! Ringaby and Forssén, "Scan Rectification for Structured Light Range Sensors with Rolling Shutters", ICCV
//! 2011).

use nalgebra::{Isometry3, Vector3};

use super::blocks::Blocks;
use super::point::{Motion, Point};
use crate::camera::Camera;

/// Velocity of a camera, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Velocity {
    /// m/s.
    shift: Vector3<f64>,
    /// rad/s.
    turn: Vector3<f64>,
}

impl Velocity {
    /// Mean velocity of a motion that took `seconds`; zero where no time passed.
    pub fn of(motion: &Isometry3<f64>, seconds: f64) -> Self {
        if seconds.is_nan() || seconds <= 0.0 {
            return Velocity::default();
        }
        Velocity {
            shift: motion.translation.vector / seconds,
            turn: motion.rotation.scaled_axis() / seconds,
        }
    }

    /// Motion of the camera after `seconds`, on a straight path: to a hundredth in the tens of milliseconds of
    /// a readout.
    pub fn after(&self, seconds: f64) -> Isometry3<f64> {
        Isometry3::new(self.shift * seconds, self.turn * seconds)
    }
}

impl Blocks {
    /// The blocks as seen all at the time of the middle row, by a camera with this velocity; `readout_s` is
    /// the time from the first row to the last.
    pub fn straightened(&self, velocity: &Velocity, camera: &Camera, readout_s: f64) -> Blocks {
        let height = camera.height as f64;
        let late = |row: usize| ((row as f64 + 0.5) / height - 0.5) * readout_s;
        let rows: Vec<Motion> =
            (0..camera.height).map(|row| Motion::of(&velocity.after(late(row)))).collect();
        let straight = |point: &Point| {
            let motion = &rows[point.pixel as usize / camera.width];
            let (at, normal) = (motion.moved(&point.at), motion.turned(&point.normal));
            Point { at, normal, ..*point }
        };
        let points = self.points.iter().map(|p| p.as_ref().map(straight)).collect();
        Blocks { points, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A static point is seen from a different place in each row; after the correction all agree.
    #[test]
    fn a_still_point_is_in_one_place_whatever_row_saw_it() {
        let camera = Camera::centred(640, 480, 525.0);
        let motion =
            Isometry3::new(Vector3::new(0.02, -0.01, 0.03), Vector3::new(0.03, 0.05, -0.02));
        let (interval_s, readout_s) = (1.0 / 30.0, 0.0305);
        let velocity = Velocity::of(&motion, interval_s);
        let still = Vector3::new(0.4, -0.2, 2.0);
        let seen_by = |row: usize| {
            let late = ((row as f64 + 0.5) / 480.0 - 0.5) * readout_s;
            let at = velocity.after(late).inverse() * nalgebra::Point3::from(still);
            let (at, normal) = (at.coords.cast(), -Vector3::z());
            Some(Point { at, normal, sigma_axial: 1.0, sigma_normal: 1.0, pixel: row as u32 * 640 })
        };
        let points: Vec<_> = [0, 100, 239, 479].into_iter().map(seen_by).collect();
        let bent = Blocks { side_px: 4, points };
        let apart = |blocks: &Blocks| {
            let off = |p: &Point| (p.at.cast::<f64>() - still).norm();
            blocks.points.iter().flatten().map(off).fold(0.0, f64::max)
        };
        assert!(apart(&bent) > 0.02, "{}", apart(&bent));
        let straight = bent.straightened(&velocity, &camera, readout_s);
        // Single precision at 2 m has steps of 0.24 um, and a dozen values are added.
        assert!(apart(&straight) < 3e-6, "{}", apart(&straight));
        // Nothing moves where no time passed.
        let still = bent.straightened(&Velocity::of(&motion, 0.0), &camera, readout_s);
        assert_eq!(still.points, bent.points);
    }
}
