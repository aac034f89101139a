//! Camera poses in the TUM format: `timestamp tx ty tz qx qy qz qw`, `world_from_camera`.

use std::fmt::Write;
use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::error::{Error, Result};
use crate::io::content_lines;
use crate::read::read_text;
use crate::units::shortest;

/// A camera pose and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// s.
    pub stamp: f64,
    pub world_from_camera: Isometry3<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    pub poses: Vec<Pose>,
    /// Lines dropped because another line has the same time (freiburg2_desk has some).
    pub repeated: usize,
}

/// Formats a trajectory file in the TUM format.
pub fn tum_text(poses: &[Pose]) -> String {
    let mut text = String::from("# timestamp tx ty tz qx qy qz qw\n");
    for Pose { stamp, world_from_camera } in poses {
        let (t, q) = (world_from_camera.translation, world_from_camera.rotation);
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{stamp:.6} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9}",
            t.x, t.y, t.z, q.i, q.j, q.k, q.w
        );
    }
    text
}

/// Reads a trajectory file; lines that begin with `#` are comments. Of lines with equal times the first
/// counts.
/// Fails, naming the line, at a line that is not eight finite numbers, whose quaternion has no length, or
/// whose time is before that of the line above; also if the file holds no pose.
pub fn read_trajectory(path: &Path) -> Result<Trajectory> {
    let mut read = Trajectory { poses: Vec::new(), repeated: 0 };
    each_line(path, |pose| {
        let before = read.poses.last().map_or(f64::NEG_INFINITY, |p: &Pose| p.stamp);
        if pose.stamp < before {
            let what = format!("time {} comes after {before}, which is later", pose.stamp);
            return Err((what, "sort the lines by time"));
        }
        if pose.stamp > before {
            read.poses.push(pose);
        } else {
            read.repeated += 1;
        }
        Ok(())
    })?;
    Ok(read)
}

/// Reads a trajectory file as the scripts of the TUM benchmark do: lines in any order, and of lines with
/// equal times the last counts.
/// Fails, naming the line, at a line that is not eight finite numbers or whose quaternion has no length;
/// also if the file holds no pose.
pub fn read_benchmark(path: &Path) -> Result<Vec<Pose>> {
    let mut poses: Vec<Pose> = Vec::new();
    each_line(path, |pose| {
        poses.push(pose);
        Ok(())
    })?;
    // The sort is stable: of equal times the last stays last, and comes first after reversing.
    poses.sort_by(|a, b| a.stamp.total_cmp(&b.stamp));
    poses.reverse();
    poses.dedup_by(|later, kept| later.stamp == kept.stamp);
    poses.reverse();
    Ok(poses)
}

fn each_line(path: &Path, mut take: impl FnMut(Pose) -> Result<(), Fault>) -> Result<()> {
    let text = read_text(path)?;
    let mut found = false;
    for (line, content) in content_lines(&text) {
        parse(content)
            .and_then(&mut take)
            .map_err(|(what, remedy)| Error::text(path, line, what, remedy))?;
        found = true;
    }
    if found { Ok(()) } else { Err(Error::text(path, 0, "no pose in it", REMEDY_FORMAT)) }
}

const REMEDY_FORMAT: &str = "write \"timestamp tx ty tz qx qy qz qw\", one pose a line";

/// Lengths of a quaternion that count as a rotation; printed quaternions have three to six decimals.
const QUATERNION_LENGTH: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// Farthest place, m: ten times the size of the earth. Anything farther is damage, and its square may
/// overflow.
pub(crate) const FARTHEST_PLACE_M: f64 = 1e8;
/// Latest stamp, s: three thousand years. Stamps in ns or us since 1970 are larger.
const LATEST_S: f64 = 1e11;

/// What is wrong with a line, and its remedy.
type Fault = (String, &'static str);

fn parse(line: &str) -> Result<Pose, Fault> {
    let numbers = line
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().map_err(|_| (format!("\"{word}\" is no number"), REMEDY_FORMAT)))
        .collect::<Result<Vec<f64>, Fault>>()?;
    let [stamp, tx, ty, tz, qx, qy, qz, qw] = numbers[..] else {
        return Err((format!("{} numbers, a pose has 8", numbers.len()), REMEDY_FORMAT));
    };
    if numbers.iter().any(|v| !v.is_finite()) {
        return Err(("a number is not finite".into(), "take the line out"));
    }
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    if stamp.abs() > LATEST_S {
        let what = format!("the timestamp {stamp} is not in seconds");
        return Err((what, "give seconds, such as 1305031098.6659"));
    }
    if [tx, ty, tz].iter().any(|v| v.abs() > FARTHEST_PLACE_M) {
        let what = format!("the place {} m is not on earth", [tx, ty, tz].map(shortest).join(" "));
        return Err((what, "take the line out, or give metres"));
    }
    if !QUATERNION_LENGTH.contains(&quaternion.norm()) {
        let what =
            format!("the quaternion {} is no rotation", [qx, qy, qz, qw].map(shortest).join(" "));
        return Err((what, "take the line out, or give qx qy qz qw of length 1"));
    }
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    let world_from_camera = Isometry3::from_parts(Translation3::new(tx, ty, tz), rotation);
    Ok(Pose { stamp, world_from_camera })
}

/// Indices into the two lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Pair {
    pub first: usize,
    pub second: usize,
}

/// Associates stamps that differ by less than `limit`, s: the nearest pair first, each stamp once, in the
/// order of the first list. Both lists must be in time order.
///
/// ```
/// use kinoise::trajectory::{associate, Pair};
/// let pairs = associate(&[0.0, 0.1], &[0.011, 0.089, 0.09], 0.02);
/// assert_eq!(pairs, [Pair { first: 0, second: 0 }, Pair { first: 1, second: 2 }]);
/// ```
pub fn associate(first: &[f64], second: &[f64], limit: f64) -> Vec<Pair> {
    let mut near: Vec<(f64, Pair)> = Vec::new();
    let mut begin = 0;
    for (i, &a) in first.iter().enumerate() {
        // Inclusive here; the exact comparison below decides at the edges.
        while begin < second.len() && second[begin] < a - limit {
            begin += 1;
        }
        let within = second[begin..].iter().take_while(|&&b| b <= a + limit).count();
        for (k, &b) in second[begin..begin + within].iter().enumerate() {
            let apart = (a - b).abs();
            if apart < limit {
                near.push((apart, Pair { first: i, second: begin + k }));
            }
        }
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (mut used, mut taken) = (vec![false; first.len()], vec![false; second.len()]);
    let mut pairs: Vec<Pair> = near
        .into_iter()
        .filter_map(|(_, pair)| {
            let free = !used[pair.first] && !taken[pair.second];
            used[pair.first] |= free;
            taken[pair.second] |= free;
            free.then_some(pair)
        })
        .collect();
    pairs.sort();
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The script's own double loop.
    fn by_the_book(first: &[f64], second: &[f64], limit: f64) -> Vec<Pair> {
        let mut all = Vec::new();
        for (i, a) in first.iter().enumerate() {
            for (j, b) in second.iter().enumerate() {
                if (a - b).abs() < limit {
                    all.push(((a - b).abs(), Pair { first: i, second: j }));
                }
            }
        }
        all.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let mut pairs: Vec<Pair> = Vec::new();
        for (_, p) in all {
            if pairs.iter().all(|q| q.first != p.first && q.second != p.second) {
                pairs.push(p);
            }
        }
        pairs.sort();
        pairs
    }

    proptest! {
        #[test]
        fn as_the_script_does(
            mut a in prop::collection::vec(0.0f64..1.0, 0..40),
            mut b in prop::collection::vec(0.0f64..1.0, 0..40),
            limit in 0.0f64..0.2,
        ) {
            a.sort_by(f64::total_cmp);
            b.sort_by(f64::total_cmp);
            prop_assert_eq!(associate(&a, &b, limit), by_the_book(&a, &b, limit));
        }
    }
}
