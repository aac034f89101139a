//! Camera poses in the TUM format: `timestamp tx ty tz qx qy qz qw`, `world_from_camera`.

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::Pose;
use crate::error::{Error, Result};

/// Read a trajectory file; lines that begin with `#` are comments.
///
/// # Errors
/// With the line, when it is not eight finite numbers, its quaternion has no length, or its time
/// is not after the line's before; and when the file holds no pose.
pub fn read_trajectory(path: &Path) -> Result<Vec<Pose>> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::read(path, e))?;
    let mut poses: Vec<Pose> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let content = line.trim_start_matches('\u{feff}').trim();
        if content.is_empty() || content.starts_with('#') {
            continue;
        }
        let after = poses.last().map_or(f64::NEG_INFINITY, |p| p.stamp);
        poses.push(parse(content, after).map_err(|fault| fault.at(path, i + 1))?);
    }
    if poses.is_empty() {
        return Err(Fault::new("no pose in it", REMEDY_FORMAT).at(path, 0));
    }
    Ok(poses)
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

fn parse(line: &str, after: f64) -> Result<Pose, Fault> {
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
    if stamp <= after {
        let what = format!("time {stamp} is not after the pose before, {after}");
        return Err(Fault::new(what, "sort the lines by time, each time once"));
    }
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    let world_from_camera = Isometry3::from_parts(Translation3::new(tx, ty, tz), rotation);
    Ok(Pose { stamp, world_from_camera })
}
