//! The layout of the TUM RGB-D benchmark.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::{Moment, Sequence};
use crate::error::{Error, Result};
use crate::io::{
    Assumed, DESCRIPTION, Layout, content_lines, entries, open_uncut, read_list, results_in,
};
use crate::read::{first_there, is_there, read_text};
use crate::trajectory::{associate, read_benchmark};
use crate::view::FrameRef;

/// Largest difference between timestamps of one moment, s (associate.py's `max_difference`).
const MAX_DIFFERENCE_S: f64 = 0.02;
/// Usual file names for the output of associate.py.
const ASSOCIATIONS: [&str; 4] =
    ["associations.txt", "association.txt", "associate.txt", "associated.txt"];

pub(super) fn open(root: &Path, assumed: &Assumed) -> Result<Sequence> {
    if !matches!(Layout::of(root)?, Layout::Sequence | Layout::Container) {
        return Err(no_sequence(root));
    }
    let recording = open_uncut(root, assumed)?;
    let mut remarks = recording.remarks;
    // A film that is not cut is one view.
    let temperature_c = recording.views.first().and_then(|v| v.notes.temperature_c);
    let depth = recording.views.into_iter().flat_map(|v| v.depth).collect();
    let moments = with_colour(root, depth, &mut remarks)?;
    let truth = root.join("groundtruth.txt");
    let read = is_there(&truth).and_then(|there| match there {
        true => read_benchmark(&truth),
        false => Ok(Vec::new()),
    });
    let (truth, unused_truth) = match read {
        Ok(poses) => (poses, None),
        Err(e) => (Vec::new(), Some(e.to_string())),
    };
    remarks.extend(unused_truth.iter().map(|why| format!("the ground truth is not used: {why}")));
    let root = root.to_path_buf();
    let sensor = recording.sensor;
    Ok(Sequence { root, sensor, temperature_c, moments, truth, unused_truth, remarks })
}

fn no_sequence(root: &Path) -> Error {
    if let Some(error) = results_in(root) {
        return error;
    }
    if root.join(DESCRIPTION).is_file() {
        let what = "it is a recording of still views, no film to map";
        return Error::recording(
            root,
            what,
            "give a sequence, in the layout of TUM or of 7-Scenes",
        );
    }
    let below = entries(root).unwrap_or_default();
    let film = below.iter().find(|p| p.is_dir() && p.join("depth.txt").is_file());
    match film.and_then(|p| p.file_name()) {
        Some(name) => Error::recording(
            root,
            format!("this folder holds no sequence, but {}/ in it does", name.to_string_lossy()),
            "give that folder",
        ),
        None => Error::recording(
            root,
            "no sequence to map: neither depth.txt nor frame-000000.depth.png is in this folder",
            "give a folder in the layout of the TUM RGB-D benchmark or of 7-Scenes, a ROS bag, or a NumPy stack",
        ),
    }
}

/// Pairs every depth image with the colour image of its moment.
fn with_colour(
    root: &Path,
    depth: Vec<FrameRef>,
    remarks: &mut Vec<String>,
) -> Result<Vec<Moment>> {
    let associations = first_there(ASSOCIATIONS.map(|name| root.join(name)))?;
    let partner = match associations {
        Some(file) => listed(root, &file, &depth)?,
        None => nearest(root, &depth, remarks)?,
    };
    let moment = |(depth, colour): (FrameRef, Option<FrameRef>)| Moment {
        stamp: depth.timestamp,
        depth,
        colour,
    };
    Ok(depth.into_iter().zip(partner).map(moment).collect())
}

fn nearest(
    root: &Path,
    depth: &[FrameRef],
    remarks: &mut Vec<String>,
) -> Result<Vec<Option<FrameRef>>> {
    let path = root.join("rgb.txt");
    if !is_there(&path)? {
        return Ok(vec![None; depth.len()]);
    }
    let colour = read_list(&path)?;
    remarks.extend(colour.remarks);
    let stamps = |frames: &[FrameRef]| frames.iter().map(|f| f.timestamp).collect::<Vec<f64>>();
    let mut partner = vec![None; depth.len()];
    for pair in associate(&stamps(depth), &stamps(&colour.frames), MAX_DIFFERENCE_S) {
        partner[pair.first] = Some(colour.frames[pair.second].clone());
    }
    Ok(partner)
}

/// Reads "stamp path stamp path" lines, with colour and depth in either order.
fn listed(root: &Path, file: &Path, depth: &[FrameRef]) -> Result<Vec<Option<FrameRef>>> {
    let text = read_text(file)?;
    let place: HashMap<&PathBuf, usize> =
        depth.iter().enumerate().map(|(k, f)| (&f.path, k)).collect();
    let mut partner = vec![None; depth.len()];
    for (line, content) in content_lines(&text) {
        let words: Vec<&str> = content.split_whitespace().collect();
        let [first, one, second, other] = words[..] else {
            let what = format!("{} words where \"stamp path stamp path\" is due", words.len());
            let remedy = "make the file again with associate.py, or take it out";
            return Err(Error::text(file, line, what, remedy));
        };
        let [one, other] = [one, other].map(|name| root.join(name));
        let (k, stamp, colour) = match (place.get(&one), place.get(&other)) {
            (_, Some(&k)) => (k, first, one),
            (Some(&k), None) => (k, second, other),
            (None, None) => continue,
        };
        // Without a valid time in the list, the depth image's is used.
        let stamp =
            stamp.parse().ok().filter(|s: &f64| s.is_finite()).unwrap_or(depth[k].timestamp);
        partner[k] = colour.is_file().then(|| FrameRef::file(stamp, colour));
    }
    Ok(partner)
}
