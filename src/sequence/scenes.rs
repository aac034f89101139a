//! The layout of Microsoft's 7-Scenes: frame-XXXXXX.color.png, .depth.png, .pose.txt, no timestamps.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::{Moment, Sequence};
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::io::{Assumed, entries, refuse_impossible, size_of};
use crate::read::{first_there, is_there, read_text};
use crate::trajectory::{FARTHEST_PLACE_M, Pose};
use crate::view::FrameRef;

const DEPTH: &str = ".depth.png";
/// Nominal; the frames carry no timestamps.
const RATE_HZ: f64 = 30.0;
/// Intrinsics that 7-Scenes states for its Kinects: fx, fy, cx, cy, px.
const INTRINSICS: [f64; 4] = [585.0, 585.0, 320.0, 240.0];
/// Millimetres; 65535 is no measurement.
const CODE: DepthCode = DepthCode::Metric { units_per_metre: 1000.0, invalid: 65535 };

/// Whether the folder holds frame-XXXXXX.depth.png and no depth.txt.
pub(super) fn is_one(root: &Path) -> bool {
    !root.join("depth.txt").is_file()
        && entries(root).is_ok_and(|files| files.iter().any(|p| stem(p).is_some()))
}

/// Name (frame-XXXXXX) and number of a depth image.
fn stem(path: &Path) -> Option<(String, u32)> {
    let name = path.file_name()?.to_str()?.strip_suffix(DEPTH)?;
    let number = name.strip_prefix("frame-")?.parse().ok()?;
    Some((name.to_string(), number))
}

pub(super) fn open(root: &Path, assumed: &Assumed) -> Result<Sequence> {
    assumed.refuse_topic(root)?;
    let mut remarks = vec!["7-Scenes has no stamps: frame number / 30 Hz is taken".to_string()];
    let (mut moments, mut truth) = (Vec::new(), Vec::new());
    for path in entries(root)? {
        let Some((name, number)) = stem(&path) else { continue };
        let stamp = f64::from(number) / RATE_HZ;
        let colour = ["color.png", "color.jpg"].map(|kind| root.join(format!("{name}.{kind}")));
        let colour = first_there(colour)?.map(|p| FrameRef::file(stamp, p));
        let pose = root.join(format!("{name}.pose.txt"));
        if is_there(&pose)? {
            match read_pose(&pose)? {
                Some(world_from_camera) => truth.push(Pose { stamp, world_from_camera }),
                None => remarks.push(format!("{} is no pose; left out", pose.display())),
            }
        }
        moments.push(Moment { stamp, depth: FrameRef::file(stamp, path), colour });
    }
    moments.sort_by(|a, b| a.stamp.total_cmp(&b.stamp));
    truth.sort_by(|a, b| a.stamp.total_cmp(&b.stamp));
    let size = size_of(&moments[0].depth)?;
    let own = "7-Scenes' own intrinsics 585,585,320,240";
    match (assumed.intrinsics, assumed.preset) {
        (None, None) => {
            remarks.push(format!("{own} are used; give --intrinsics for another camera"));
        }
        (None, Some(_)) => remarks.push(format!("--sensor replaces {own}")),
        (Some(given), _) if given != INTRINSICS => {
            remarks.push(format!("--intrinsics replaces {own}"));
        }
        (Some(_), _) => {}
    }
    let sensor = assumed.sensor("7-Scenes Kinect", size, INTRINSICS, CODE)?;
    let frames: Vec<&FrameRef> = moments.iter().map(|m| &m.depth).collect();
    remarks.extend(refuse_impossible(root, &sensor, &frames)?);
    Ok(Sequence {
        root: root.to_path_buf(),
        sensor,
        temperature_c: None,
        moments,
        truth,
        unused_truth: None,
        remarks,
    })
}

/// Reads a 4 x 4 matrix, `world_from_camera`; `None` if tracking had failed (not finite).
fn read_pose(path: &Path) -> Result<Option<Isometry3<f64>>> {
    let text = read_text(path)?;
    let numbers: Vec<f64> = text.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    if numbers.len() != 16 {
        let what = format!("{} numbers, a pose has 4 x 4", numbers.len());
        return Err(Error::text(path, 0, what, REMEDY_POSE));
    }
    if numbers.iter().any(|v| !v.is_finite()) {
        return Ok(None);
    }
    let turn = Matrix3::from_fn(|i, j| numbers[4 * i + j]);
    if let Some(what) = fault(&turn, &numbers) {
        return Err(Error::text(path, 0, what, REMEDY_POSE));
    }
    // Rounded digits leave it slightly off a rotation.
    let near = Rotation3::from_matrix_eps(&turn, f64::EPSILON, MAX_ROUNDS, Rotation3::identity());
    let rotation = UnitQuaternion::from_rotation_matrix(&near);
    let shift = Vector3::new(numbers[3], numbers[7], numbers[11]);
    Ok(Some(Isometry3::from_parts(Translation3::from(shift), rotation)))
}

const REMEDY_POSE: &str = "restore the file, or take it out";
/// Tolerance on a rotation: products of rows of printed digits are off by a thousandth.
const OFF_ROTATION: f64 = 0.01;
/// From there the search for the nearest rotation converges in a few rounds.
const MAX_ROUNDS: usize = 100;

/// Why these 4 x 4 numbers, with the 3 x 3 part `turn`, are not a rigid motion.
fn fault(turn: &Matrix3<f64>, numbers: &[f64]) -> Option<String> {
    let off = (turn * turn.transpose() - Matrix3::identity()).amax();
    if off.is_nan() || off > OFF_ROTATION {
        return Some(
            "its 3 x 3 part is no rotation: its rows are not orthogonal unit vectors".into(),
        );
    }
    if turn.determinant() < 0.0 {
        return Some("its 3 x 3 part is no rotation: it mirrors (its determinant is -1)".into());
    }
    let last = [0.0, 0.0, 0.0, 1.0].iter().zip(&numbers[12..]);
    if last.into_iter().any(|(due, given)| (due - given).abs() > OFF_ROTATION) {
        return Some("its last line is not 0 0 0 1".into());
    }
    let far = [3, 7, 11].iter().any(|&k| numbers[k].abs() > FARTHEST_PLACE_M);
    far.then(|| "its place is not on earth".into())
}
