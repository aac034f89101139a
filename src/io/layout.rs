//! The recording layout: recording.json and one folder per view (`crate::docs::layouts`).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::list::{FrameList, read_list};
use super::output::{entries, write_json};
use crate::error::{Error, Result};
use crate::frame::FARTHEST_M;
use crate::read::{absurd, is_there, plainly, read_json};
use crate::units::shortest;
use crate::view::{
    Excluded, RECORDING_FORMAT, Recording, RecordingFile, Region, Sensor, TargetSize, View,
    ViewNotes,
};

pub const DESCRIPTION: &str = "recording.json";
const VIEW_FILE: &str = "view.json";
pub(crate) const DEPTH_LIST: &str = "depth.txt";
pub(crate) const INDEX: &str = "INDEX.txt";
/// Files that make a folder a recording.
pub(crate) const DESCRIPTIONS: [&str; 3] = [DESCRIPTION, INDEX, DEPTH_LIST];
const INFRARED_LIST: &str = "ir.txt";
const REMEDY_JSON: &str = "compare it with the recording layout in the README";

/// `view.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ViewFile {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<TargetSize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_distance_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_uncertainty_m: Option<f64>,
    /// The target's region u0, v0, u1, v1, px; both edges belong to it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roi: Option<[f64; 4]>,
    /// The target's corners u, v, px; may reach outside the image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub polygon: Option<Vec<[f64; 2]>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ambient_lux: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub notes: Option<String>,
}

impl ViewFile {
    fn of(notes: &ViewNotes) -> Self {
        let (roi, polygon) = match &notes.region {
            Some(Region::Rectangle(r)) => (Some(*r), None),
            Some(Region::Polygon(p)) => (None, Some(p.clone())),
            None => (None, None),
        };
        ViewFile {
            target: notes.target,
            reference_distance_m: notes.reference_distance_m,
            reference_uncertainty_m: notes.reference_uncertainty_m,
            roi,
            polygon,
            temperature_c: notes.temperature_c,
            ambient_lux: notes.ambient_lux,
            notes: notes.notes.clone(),
        }
    }

    fn notes(self) -> Result<ViewNotes, String> {
        self.check_ranges()?;
        let region = match (self.roi, self.polygon) {
            (Some(_), Some(_)) => return Err("both roi and polygon are given; keep one".into()),
            (Some(r), None) => {
                if !(r[2] > r[0] && r[3] > r[1]) {
                    return Err(format!("roi {r:?} is empty; it is [u0, v0, u1, v1]"));
                }
                Some(Region::Rectangle(r))
            }
            (None, Some(p)) if p.len() < 3 => {
                return Err(format!("a polygon needs three corners, this one has {}", p.len()));
            }
            (None, polygon) => polygon.map(Region::Polygon),
        };
        let notes = ViewNotes {
            target: self.target,
            reference_distance_m: self.reference_distance_m,
            reference_uncertainty_m: self.reference_uncertainty_m,
            region,
            temperature_c: self.temperature_c,
            ambient_lux: self.ambient_lux,
            notes: self.notes,
        };
        match notes.fault() {
            Some(what) => Err(what),
            None => Ok(notes),
        }
    }
}

/// Allowed ranges of a view's numbers.
const LENGTH_M: [f64; 2] = [1e-3, FARTHEST_M];
/// Electronics fail long before these limits.
const TEMPERATURE_C: [f64; 2] = [-100.0, 200.0];
/// Direct sunlight is 1.3e5 lx.
const AMBIENT_LUX: [f64; 2] = [0.0, 1e6];

impl ViewFile {
    fn check_ranges(&self) -> Result<(), String> {
        let size = self.target.map(|t| [t.width_m, t.height_m]);
        for (key, value, [low, high]) in [
            ("width_m", size.map(|s| s[0]), LENGTH_M),
            ("height_m", size.map(|s| s[1]), LENGTH_M),
            ("reference_distance_m", self.reference_distance_m, LENGTH_M),
            ("temperature_c", self.temperature_c, TEMPERATURE_C),
            ("ambient_lux", self.ambient_lux, AMBIENT_LUX),
        ] {
            if let Some(v) = value.filter(|v| !(low..=high).contains(v)) {
                return Err(format!("{key} = {} is not from {low} to {high}", shortest(v)));
            }
        }
        Ok(())
    }
}

pub(super) fn is_view(folder: &Path) -> bool {
    let listed = [DEPTH_LIST, VIEW_FILE].iter().any(|name| folder.join(name).exists());
    listed && folder.is_dir()
}

pub(super) fn open(root: &Path) -> Result<Recording> {
    let path = root.join(DESCRIPTION);
    let mut unknown = UnknownKeys::default();
    let sensor = read_sensor(&path, &mut unknown)?;
    let mut recording = Recording {
        root: root.to_path_buf(),
        sensor,
        views: Vec::new(),
        excluded: Vec::new(),
        remarks: Vec::new(),
        captures: false,
        described_by: vec![path],
    };
    for folder in entries(root)? {
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !is_view(&folder) {
            // A folder that cannot be read may be a view.
            if let (true, Err(e)) = (folder.is_dir(), std::fs::read_dir(&folder)) {
                recording.excluded.push(Excluded::of(&name, &Error::read(&folder, e)));
            } else if folder.join("depth").is_dir() {
                let what = "it has a folder depth, but no depth.txt";
                let error =
                    Error::recording(&folder, what, "list its images with their times there");
                recording.excluded.push(Excluded::of(&name, &error));
            }
            continue;
        }
        match open_view(&folder, &name, &mut recording, &mut unknown) {
            Ok(view) => recording.views.push(view),
            Err(e) => recording.excluded.push(Excluded::of(&name, &e)),
        }
    }
    recording.remarks.extend(unknown.remarks());
    Ok(recording)
}

pub(super) fn read_sensor(path: &Path, unknown: &mut UnknownKeys) -> Result<Sensor> {
    let text = read_json(path)?;
    // Another format has other keys: its name says more than the first missing key.
    let Format { format } = parse(path, &text)?;
    if format != RECORDING_FORMAT {
        let what = format!("format is \"{format}\", expected \"{RECORDING_FORMAT}\"");
        return Err(wrong(path, &text, what));
    }
    let good = json!({
        "format": "", "sensor": "", "width": 1, "height": 1, "fx": 1, "fy": 1, "cx": 1, "cy": 1
    });
    let file: RecordingFile = parse_whole(path, &text, &good, unknown)?;
    file.sensor().map_err(|what| wrong(path, &text, what))
}

/// The sensor of a `recording.json`.
pub(crate) fn read_description(path: &Path) -> Result<Sensor> {
    read_sensor(path, &mut UnknownKeys::default())
}

#[derive(Deserialize)]
struct Format {
    format: String,
}

fn parse<T: serde::de::DeserializeOwned>(path: &Path, text: &str) -> Result<T> {
    serde_json::from_str(text).map_err(|e| Error::text(path, e.line(), plainly(&e), REMEDY_JSON))
}

/// Line of the first key that a message names; 0 if it names none.
fn line_named(text: &str, message: &str) -> usize {
    // "sensor's" is not a key.
    let words = message.split(|c: char| !(c.is_alphanumeric() || "_'".contains(c)));
    let line_of = |word: &str| {
        let key = format!("\"{word}\"");
        let holds = |line: &str| {
            line.split_once(&key).is_some_and(|(_, rest)| rest.trim_start().starts_with(':'))
        };
        text.lines().position(holds)
    };
    words.filter(|w| !w.is_empty()).find_map(line_of).map_or(0, |k| k + 1)
}

/// As [`parse`], but names the key whose value has the wrong type, which serde does not: the one
/// that breaks a `good` document.
fn parse_named<T: serde::de::DeserializeOwned>(path: &Path, text: &str, good: &Value) -> Result<T> {
    let spoils = |(key, value): (&String, &Value)| {
        let mut trial = good.clone();
        trial[key] = value.clone();
        let why = serde_json::from_value::<T>(trial).err()?;
        let what = format!("{key}: {}", plainly(&why));
        Some(Error::text(path, line_named(text, key), what, REMEDY_JSON))
    };
    parse(path, text).map_err(|e| {
        let given: Value = serde_json::from_str(text).unwrap_or_default();
        given.as_object().and_then(|all| all.iter().find_map(spoils)).unwrap_or(e)
    })
}

/// As [`parse_named`], but also rejects absurd values and notes unknown keys.
fn parse_whole<T: Serialize + serde::de::DeserializeOwned>(
    path: &Path,
    text: &str,
    good: &Value,
    unknown: &mut UnknownKeys,
) -> Result<T> {
    let file = parse_named::<T>(path, text, good)?;
    let given = parse(path, text)?;
    if let Some(what) = absurd(&given) {
        return Err(wrong(path, text, what));
    }
    unknown.note(path, &given, &json!(file));
    Ok(file)
}

/// Error at the line of the key that `what` names.
fn wrong(path: &Path, text: &str, what: String) -> Error {
    Error::text(path, line_named(text, &what), what, REMEDY_JSON)
}

fn open_view(
    folder: &Path,
    name: &str,
    recording: &mut Recording,
    unknown: &mut UnknownKeys,
) -> Result<View> {
    let depth_list = folder.join(DEPTH_LIST);
    let depth = read_list(&depth_list)?;
    let of_view = |remark: &String| format!("view {name}: {remark}");
    recording.remarks.extend(depth.remarks.iter().map(of_view));
    if depth.frames.is_empty() {
        return Err(Error::recording(
            &depth_list,
            "no frame can be read",
            "list at least one existing depth image",
        ));
    }
    let infrared_list = folder.join(INFRARED_LIST);
    let infrared =
        if is_there(&infrared_list)? { read_list(&infrared_list)? } else { FrameList::default() };
    recording.remarks.extend(infrared.remarks.iter().map(of_view));
    let view_file = folder.join(VIEW_FILE);
    let notes = if is_there(&view_file)? {
        let notes = read_notes(&view_file, unknown)?;
        recording.described_by.push(view_file);
        notes
    } else {
        ViewNotes::default()
    };
    recording.described_by.push(depth_list);
    Ok(View { name: name.into(), depth: depth.frames, infrared: infrared.frames, notes })
}

fn read_notes(path: &Path, unknown: &mut UnknownKeys) -> Result<ViewNotes> {
    let text = read_json(path)?;
    let file: ViewFile = parse_whole(path, &text, &json!({}), unknown)?;
    file.notes().map_err(|what| wrong(path, &text, what))
}

/// Writes `view.json` into the view's folder, unless the notes are empty.
pub fn write_view_notes(folder: &Path, notes: &ViewNotes) -> Result<()> {
    if *notes == ViewNotes::default() {
        return Ok(());
    }
    let remedy = "the view's numbers must be finite";
    write_json(&folder.join(VIEW_FILE), &ViewFile::of(notes), remedy).map(drop)
}

/// Writes `recording.json` for `sensor` into `root`.
pub fn write_recording_file(root: &Path, sensor: &Sensor) -> Result<()> {
    let remedy = "the sensor's numbers must be finite";
    write_json(&root.join(DESCRIPTION), &RecordingFile::of(sensor), remedy).map(drop)
}

/// Keys that no part of the program reads, and the files that contain them: typing mistakes or a newer
/// layout. Reported but not fatal, so that files of later versions stay readable.
#[derive(Default)]
pub(super) struct UnknownKeys(BTreeMap<String, Vec<PathBuf>>);

impl UnknownKeys {
    /// Notes the keys of `given` missing from `understood` (the same document, parsed and serialised again).
    pub fn note(&mut self, path: &Path, given: &Value, understood: &Value) {
        for key in unknown_keys(given, understood) {
            self.0.entry(key).or_default().push(path.to_path_buf());
        }
    }

    /// One remark per key, not per file.
    pub fn remarks(&self) -> impl Iterator<Item = String> {
        self.0.iter().map(|(key, files)| {
            let others = match files.len() - 1 {
                0 => String::new(),
                n => format!(" and {n} more"),
            };
            format!("{}{others}: unknown key \"{key}\", which has no effect", files[0].display())
        })
    }
}

fn unknown_keys(given: &Value, understood: &Value) -> Vec<String> {
    let Some(given) = given.as_object() else { return Vec::new() };
    given
        .iter()
        // Some programs write null for "not given".
        .filter(|(_, value)| !value.is_null())
        .flat_map(|(key, value)| match understood.get(key) {
            None => vec![key.clone()],
            Some(known) => {
                unknown_keys(value, known).iter().map(|inner| format!("{key}.{inner}")).collect()
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn keys_are_found_at_any_depth_and_null_is_not_given() {
        let given = json!({
            "roi": [0, 0, 9, 9], "distance_m": 2, "colour": null, "target": {"width_m": 1, "depth_m": 0.1}
        });
        let understood = json!({"roi": [0.0, 0.0, 9.0, 9.0], "target": {"width_m": 1.0}});
        assert_eq!(unknown_keys(&given, &understood), ["distance_m", "target.depth_m"]);
    }
}
