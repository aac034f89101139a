//! Camera poses in the TUM format: `timestamp tx ty tz qx qy qz qw`, `world_from_camera`.

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::Pose;
use crate::error::{Error, Result};

/// The poses of a file, in time order.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    pub poses: Vec<Pose>,
    /// Lines left out because their time is the line's before (freiburg2_desk has some).
    pub repeated: usize,
}

/// Read a trajectory file; lines that begin with `#` are comments.
///
/// # Errors
/// With the line, when it is not eight finite numbers, its quaternion has no length, or its time
/// is before that of the line above; and when the file holds no pose.
pub fn read_trajectory(path: &Path) -> Result<Trajectory> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::read(path, e))?;
    let mut read = Trajectory { poses: Vec::new(), repeated: 0 };
    for (i, line) in text.lines().enumerate() {
        let content = line.trim_start_matches('\u{feff}').trim();
        if content.is_empty() || content.starts_with('#') {
            continue;
        }
        let before = read.poses.last().map_or(f64::NEG_INFINITY, |p| p.stamp);
        let pose = parse(content, before).map_err(|fault| fault.at(path, i + 1))?;
        if pose.stamp > before {
            read.poses.push(pose);
        } else {
            read.repeated += 1;
        }
    }
    if read.poses.is_empty() {
        return Err(Fault::new("no pose in it", REMEDY_FORMAT).at(path, 0));
    }
    Ok(read)
}

const REMEDY_FORMAT: &str = "write \"timestamp tx ty tz qx qy qz qw\", one pose a line";

/// Printed quaternions have three to six decimals; one shorter than this is no rotation.
const SHORTEST_QUATERNION: f64 = 0.5;

struct Fault {
    what: String,
    remedy: &'static str,
}

impl Fault {
    fn new(what: impl Into<String>, remedy: &'static str) -> Self {
        Fault { what: what.into(), remedy }
    }

    fn at(self, path: &Path, line: usize) -> Error {
        Error::Text { path: path.to_path_buf(), line, what: self.what, remedy: self.remedy }
    }
}

fn parse(line: &str, before: f64) -> Result<Pose, Fault> {
    let numbers = line
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|word| !word.is_empty())
        .map(|word| {
            word.parse().map_err(|_| Fault::new(format!("\"{word}\" is no number"), REMEDY_FORMAT))
        })
        .collect::<Result<Vec<f64>, Fault>>()?;
    let [stamp, tx, ty, tz, qx, qy, qz, qw] = numbers[..] else {
        let what = format!("{} numbers, a pose has 8", numbers.len());
        return Err(Fault::new(what, REMEDY_FORMAT));
    };
    if numbers.iter().any(|v| !v.is_finite()) {
        return Err(Fault::new("a number is not finite", "take the line out"));
    }
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    if quaternion.norm() < SHORTEST_QUATERNION {
        let what = format!("the quaternion {qx} {qy} {qz} {qw} is no rotation");
        return Err(Fault::new(what, "take the line out, or give qx qy qz qw of length 1"));
    }
    if stamp < before {
        let what = format!("time {stamp} comes after {before}, which is later");
        return Err(Fault::new(what, "sort the lines by time"));
    }
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    let world_from_camera = Isometry3::from_parts(Translation3::new(tx, ty, tz), rotation);
    Ok(Pose { stamp, world_from_camera })
}
