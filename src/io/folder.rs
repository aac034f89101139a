//! Folders of depth images without recording.json's views: a TUM sequence, plain PNGs, and a fakenect
//! dump (INDEX.txt and `d-<time>-<stamp>.pgm`, raw 11-bit values of a Kinect v1).

use std::path::{Path, PathBuf};

use super::assumed::Assumed;
use super::images::size_of;
use super::layout::{
    DEPTH_LIST, DESCRIPTION, DESCRIPTIONS, INDEX, UnknownKeys, is_view, read_sensor,
};
use super::list::{FrameList, put_in_order, read_list, shorten};
use super::output::{by_number, entries, listed};
use super::stills::{Film, Footage};
use crate::error::{Error, Result};
use crate::read::{is_there, read_text};
use crate::view::{FrameRef, Sensor};

/// Reads depth.txt and depth/ of the TUM benchmark as a film of a target. A recording.json beside depth.txt
/// describes the sensor, as in simulated rooms.
pub(super) fn sequence(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let path = root.join(DEPTH_LIST);
    let list = read_list(&path)?;
    let first = list.frames.first().ok_or_else(|| {
        Error::recording(&path, "no depth frame in it", "list at least one existing depth image")
    })?;
    let (remarks, described_by) = (list.remarks, vec![path.clone()]);
    let sensor = || assumed.sequence_sensor(&path, size_of(first)?);
    let film = Footage { remarks, described_by, ..Footage::default() };
    let (film, sensor) = film.described(root, assumed, sensor)?;
    Ok((Footage { frames: list.frames, ..film }, sensor))
}

impl Footage {
    /// Adds the sensor from the recording.json in `root`, beside which nothing may be `assumed`, else from
    /// `by_options`; and remarks on either.
    fn described(
        mut self,
        root: &Path,
        assumed: &Assumed,
        by_options: impl FnOnce() -> Result<(Sensor, Option<String>)>,
    ) -> Result<(Self, Sensor)> {
        let description = root.join(DESCRIPTION);
        if !is_there(&description)? {
            let (sensor, remark) = by_options()?;
            self.remarks.extend(remark);
            return Ok((self, sensor));
        }
        assumed.refuse_beside(&description)?;
        let mut unknown = UnknownKeys::default();
        let sensor = read_sensor(&description, &mut unknown)?;
        self.remarks.extend(unknown.remarks());
        self.described_by.push(description);
        Ok((self, sensor))
    }
}

/// 30 Hz: a plain folder has no timestamps, and every sensor of this kind runs at this rate.
pub(super) const NOMINAL_INTERVAL_S: f64 = 1.0 / 30.0;

fn is_image(path: &Path) -> bool {
    is_called_image(path) && path.is_file()
}

fn is_called_image(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"))
}

/// Whether a folder holds images and no view.
pub(super) fn is_plain(root: &Path) -> Result<bool> {
    let files = entries(root)?;
    Ok(files.iter().any(|p| is_image(p)) && !files.iter().any(|p| is_view(p)))
}

/// 16-bit PNGs in name order, numbers by their value; everything else comes from recording.json or from options.
pub(super) fn images(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let mut files = entries(root)?;
    files.retain(|p| is_called_image(p));
    files.sort_by_cached_key(|p| by_number(p));
    let odd = files.extract_if(.., |p| !p.is_file()).collect::<Vec<_>>();
    let odd = odd.iter().map(|p| format!("{} is not a regular file; left out", p.display()));
    let remarks: Vec<String> = odd.collect();
    // The pictures that a calibration writes are not depth images.
    if let Some(error) = results_in(root) {
        return Err(error);
    }
    if files.is_empty() {
        return Err(nothing_in(root)?);
    }
    let stamped = files
        .into_iter()
        .enumerate()
        .map(|(i, path)| FrameRef::file(i as f64 * NOMINAL_INTERVAL_S, path));
    let frames: Vec<FrameRef> = stamped.collect();
    let film = Footage { film: Film::Captures, remarks, ..Footage::default() };
    let (film, sensor) = film.described(root, assumed, || assumed.images_sensor(root, &frames))?;
    Ok((Footage { frames, ..film }, sensor))
}

/// Error saying what the folder holds instead of a recording.
/// Fails if it cannot be listed.
pub(crate) fn nothing_in(root: &Path) -> Result<Error> {
    const REMEDY: &str =
        "give the folder of a recording, a TUM sequence, a fakenect dump or 16-bit PNGs";
    let there = entries(root)?;
    // Views have a depth.txt as films do; several of them are a recording without its description.
    let films = |p: &Path| [DESCRIPTION, "groundtruth.txt"].iter().any(|n| p.join(n).is_file());
    if there.iter().filter(|p| is_view(p) && !films(p)).count() > 1 {
        let what = "recording.json is missing beside the views in this folder";
        return Ok(Error::recording(root, what, REMEDY));
    }
    let holds = |p: &&PathBuf| p.is_dir() && holds_recording(p);
    let below: Vec<String> = there
        .iter()
        .filter(holds)
        .map(|p| format!("{}/", p.file_name().unwrap_or_default().to_string_lossy()))
        .collect();
    Ok(match &below[..] {
        [] => {
            let what = "neither recording.json, depth.txt, INDEX.txt nor a PNG is in this folder";
            Error::recording(root, what, REMEDY)
        }
        [one] => {
            let what = format!("this folder holds no recording, but {one} in it does");
            Error::recording(root, what, "give that folder")
        }
        _ => {
            let what = format!("this folder holds no recording, but {} in it do", listed(&below));
            Error::recording(root, what, "give one of them")
        }
    })
}

/// Sets of files that only the results of one command contain.
const RESULTS: [(&[&str], &str); 7] = [
    (&["diagnosis.json", "report.html"], "diagnose"),
    (&["sigma.svg", "report.html"], "calibrate"),
    (&["trajectory.txt", "map.ply"], "map"),
    (&["tables.json", "report.html"], "compare"),
    (&["evaluation.json", "report.html"], "evaluate"),
    (&["sigma.json", "sigma.txt"], "sigma"),
    (&["sigma.json"], "correct --sigma"),
];

/// Error for a folder of results given as input.
pub(crate) fn results_in(root: &Path) -> Option<Error> {
    let of = |names: &[&str]| names.iter().all(|name| root.join(name).is_file());
    let (names, command) = RESULTS.iter().find(|(names, _)| of(names))?;
    let what = format!("it holds results of kinoise {command} ({}), no depth images", names[0]);
    Some(Error::recording(root, what, "give the folder that they were made of"))
}

fn holds_recording(folder: &Path) -> bool {
    DESCRIPTIONS.iter().any(|name| folder.join(name).is_file())
        || entries(folder).is_ok_and(|files| files.iter().any(|p| is_image(p)))
}

/// Reads INDEX.txt and the depth frames it names.
pub(super) fn dump(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let index = root.join(INDEX);
    let text = read_text(&index)?;
    let mut list = FrameList::default();
    for (i, line) in text.lines().enumerate() {
        let name = line.trim();
        if !name.starts_with("d-") {
            continue;
        }
        let timestamp = stamp(name).ok_or_else(|| {
            let what = format!("\"{}\" is not d-<time>-<stamp>.pgm", shorten(name));
            Error::text(&index, i + 1, what, "record the dump with fakenect-record")
        })?;
        let path = root.join(name);
        if path.is_file() {
            list.frames.push(FrameRef::file(timestamp, path));
        } else {
            let odd = if path.exists() { "is not a regular file" } else { "is missing" };
            let name = shorten(name);
            let what = format!("INDEX.txt line {} names {name}, which {odd}; left out", i + 1);
            list.remarks.push(what);
        }
    }
    put_in_order(&mut list, INDEX);
    let FrameList { frames, mut remarks } = list;
    let first = frames.first().ok_or_else(|| {
        Error::recording(
            &index,
            "no depth frame (d-*.pgm) in it",
            "record the dump with fakenect-record",
        )
    })?;
    let (sensor, remark) = assumed.dump_sensor(size_of(first)?)?;
    remarks.extend(remark);
    let described_by = vec![index];
    Ok((Footage { frames, remarks, described_by, ..Footage::default() }, sensor))
}

/// Host time in seconds: the first number of `d-<time>-<stamp>.pgm`.
fn stamp(name: &str) -> Option<f64> {
    let rest = name.strip_prefix("d-")?.strip_suffix(".pgm")?;
    let (time, _) = rest.split_once('-')?;
    time.parse().ok().filter(|t: &f64| t.is_finite())
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_stamp_is_the_first_number() {
        assert_eq!(super::stamp("d-1316653530.207391-4127230476.pgm"), Some(1316653530.207391));
        assert_eq!(super::stamp("d-x-1.pgm"), None);
    }
}
