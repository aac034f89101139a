//! The layout of the TUM RGB-D benchmark.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::{Moment, Sequence};
use crate::error::{Error, Result, read_text};
use crate::io::{Assumed, Layout, content_lines, open_uncut, read_list};
use crate::trajectory::{associate, read_benchmark};
use crate::view::FrameRef;

/// Stamps of one moment differ by less, s (associate.py's `max_difference`).
const MAX_DIFFERENCE_S: f64 = 0.02;
/// Names under which people keep what associate.py printed.
const ASSOCIATIONS: [&str; 4] =
    ["associations.txt", "association.txt", "associate.txt", "associated.txt"];

/// What the benchmark publishes of a colour camera, to which depth is registered.
struct Published {
    name: &'static str,
    /// fx, fy, cx, cy, px.
    intrinsics: [f64; 4],
    /// k1, k2, p1, p2, k3. Depth is registered to the picture as the lens bends it: with them the
    /// RPE over 1 s of freiburg1_rpy falls from 64 to 46 mm.
    distortion: Option<[f64; 5]>,
}

const FREIBURG: [Published; 3] = [
    Published {
        name: "freiburg1",
        intrinsics: [517.3, 516.5, 318.6, 255.3],
        distortion: Some([0.2624, -0.9531, -0.0054, 0.0026, 1.1633]),
    },
    Published {
        name: "freiburg2",
        intrinsics: [520.9, 521.0, 325.1, 249.7],
        distortion: Some([0.2312, -0.7849, -0.0033, -0.0001, 0.9172]),
    },
    Published { name: "freiburg3", intrinsics: [535.4, 539.2, 320.1, 247.6], distortion: None },
];

pub(super) fn open(root: &Path, assumed: &Assumed) -> Result<Sequence> {
    if Layout::of(root)? != Layout::Sequence {
        return Err(Error::recording(
            root,
            "no sequence to map: neither depth.txt nor frame-000000.depth.png is in this folder",
            "give a folder in the layout of the TUM RGB-D benchmark or of 7-Scenes",
        ));
    }
    let mut remarks = Vec::new();
    let published = published(root, assumed);
    let mut assumed = assumed.clone();
    if let Some(of) = published {
        assumed.intrinsics = Some(of.intrinsics);
    }
    let mut recording = open_uncut(root, &assumed)?;
    if let Some(of) = published {
        remarks.push(format!("depth.txt says {}: its published camera is used", of.name));
        recording.sensor.camera.distortion = of.distortion;
    }
    remarks.extend(recording.remarks);
    let depth = recording.views.into_iter().flat_map(|v| v.depth).collect();
    let mut moments = with_colour(root, depth, &mut remarks)?;
    let before = moments.len();
    moments.dedup_by(|b, a| a.stamp == b.stamp);
    if moments.len() < before {
        let dropped = before - moments.len();
        remarks.push(format!(
            "{dropped} depth images have the stamp of the one before; only the first is mapped"
        ));
    }
    let truth = root.join("groundtruth.txt");
    let truth = if truth.is_file() {
        read_benchmark(&truth).map(|t| t.poses).unwrap_or_else(|e| {
            remarks.push(format!("the ground truth is not used: {e}"));
            Vec::new()
        })
    } else {
        Vec::new()
    };
    let root = root.to_path_buf();
    Ok(Sequence { root, sensor: recording.sensor, moments, truth, remarks })
}

/// The benchmark's lists name their bag in a comment, and with it the camera.
fn published(root: &Path, assumed: &Assumed) -> Option<&'static Published> {
    if assumed.intrinsics.is_some() || root.join("recording.json").is_file() {
        return None;
    }
    let list = std::fs::read_to_string(root.join("depth.txt")).ok()?;
    let mut head = list.lines().take_while(|line| line.starts_with('#'));
    head.find_map(|line| FREIBURG.iter().find(|p| line.contains(p.name)))
}

/// Every depth image with the colour image of its moment.
fn with_colour(
    root: &Path,
    depth: Vec<FrameRef>,
    remarks: &mut Vec<String>,
) -> Result<Vec<Moment>> {
    let associations = ASSOCIATIONS.iter().map(|name| root.join(name)).find(|p| p.is_file());
    let partner = match associations {
        Some(file) => listed(root, &file, &depth)?,
        None => nearest(root, &depth, remarks)?,
    };
    let moment = |(f, colour): (FrameRef, Option<PathBuf>)| Moment {
        stamp: f.timestamp,
        depth: f.path,
        colour,
    };
    Ok(depth.into_iter().zip(partner).map(moment).collect())
}

fn nearest(
    root: &Path,
    depth: &[FrameRef],
    remarks: &mut Vec<String>,
) -> Result<Vec<Option<PathBuf>>> {
    let path = root.join("rgb.txt");
    if !path.is_file() {
        return Ok(vec![None; depth.len()]);
    }
    let colour = read_list(&path)?;
    remarks.extend(colour.remarks);
    let stamps = |frames: &[FrameRef]| frames.iter().map(|f| f.timestamp).collect::<Vec<f64>>();
    let mut partner = vec![None; depth.len()];
    for pair in associate(&stamps(depth), &stamps(&colour.frames), MAX_DIFFERENCE_S) {
        partner[pair.first] = Some(colour.frames[pair.second].path.clone());
    }
    Ok(partner)
}

/// "stamp path stamp path" lines: colour and depth in either order.
fn listed(root: &Path, file: &Path, depth: &[FrameRef]) -> Result<Vec<Option<PathBuf>>> {
    let text = read_text(file)?;
    let place: HashMap<&PathBuf, usize> =
        depth.iter().enumerate().map(|(k, f)| (&f.path, k)).collect();
    let mut partner = vec![None; depth.len()];
    for (line, content) in content_lines(&text) {
        let words: Vec<&str> = content.split_whitespace().collect();
        let [_, one, _, other] = words[..] else {
            let what = format!("{} words where \"stamp path stamp path\" is due", words.len());
            let remedy = "make the file again with associate.py, or take it out";
            return Err(Error::text(file, line, what, remedy));
        };
        let [one, other] = [one, other].map(|name| root.join(name));
        let (depth_index, colour) = match (place.get(&one), place.get(&other)) {
            (_, Some(&k)) => (k, one),
            (Some(&k), None) => (k, other),
            (None, None) => continue,
        };
        partner[depth_index] = colour.is_file().then_some(colour);
    }
    Ok(partner)
}
