//! A motion of the camera that depth does not determine, by name.

use std::fmt;

use nalgebra::{Vector3, Vector6};

/// A unit motion in the frame of the alignment's target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction {
    /// m.
    pub shift: Vector3<f64>,
    /// In units of the scene's reach: comparable with the shift.
    pub turn: Vector3<f64>,
    /// Mean square distance that it moves points across their surfaces, of 1 at most.
    pub share: f64,
}

impl Direction {
    pub fn of(motion: &Vector6<f64>, share: f64) -> Self {
        Direction {
            shift: motion.fixed_rows::<3>(0).into_owned(),
            turn: motion.fixed_rows::<3>(3).into_owned(),
            share,
        }
    }

    /// "shift along x", "turn about z", with the axis that has most of it.
    pub fn name(&self) -> String {
        let (verb, axis) = if self.shift.norm() >= self.turn.norm() {
            ("shift along", self.shift)
        } else {
            ("turn about", self.turn)
        };
        format!("{verb} {}", ["x", "y", "z"][axis.iamax()])
    }
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name())
    }
}
