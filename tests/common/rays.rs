//! Raytraced sets on disk, and their diagnoses.

use std::fs;
use std::path::{Path, PathBuf};

use crate::raytraced::{Cell, Order, Set, write};
use kinoise::diagnose::{DiagnoseOptions, diagnose};
use kinoise::io::{Assumed, open};
use kinoise::{NoiseModel, Seed};
use serde_json::Value;

/// Files of one set, deleted on drop.
pub struct OnDisk {
    pub folder: tempfile::TempDir,
    pub recording: PathBuf,
    pub model: PathBuf,
    pub set: Set,
}

/// An order of 320 x 240 px images at strength 1.
pub fn order(cell: Cell, effect: &str, seed: u64, views: usize, frames: usize) -> Order {
    let effects = if effect.is_empty() { Vec::new() } else { vec![effect.to_string()] };
    let (views, frames) = (Some(views), Some(frames));
    Order { cell, effects, strength: 1.0, seed, views, frames, small: true }
}

pub fn on_disk(order: Order) -> OnDisk {
    let set = Set::draw(order).expect("an effect that exists");
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder");
    write(&set, folder.path()).expect("written");
    let recording = folder.path().join(&set.name);
    let model = folder.path().join("model").join(format!("{}.json", set.name));
    OnDisk { folder, recording, model, set }
}

impl OnDisk {
    pub fn diagnosis(&self) -> Said {
        said(&self.recording, &self.model)
    }
}

/// `diagnosis.json`, and the extended model.
pub struct Said {
    pub json: Value,
    pub model: NoiseModel,
    /// Paths of numbers that are null.
    pub nulls: Vec<String>,
}

/// Diagnosis of a recording against a model.
#[track_caller]
pub fn said(recording: &Path, model: &Path) -> Said {
    let recording = open(recording, &Assumed::default()).expect("a recording");
    let model = NoiseModel::read(model).expect("a model");
    let options = DiagnoseOptions { seed: Seed(1), ..DiagnoseOptions::default() };
    let done = diagnose(&recording, &model, &options, &|_, _| ()).expect("a diagnosis");
    let json = serde_json::to_value(&done.diagnosis).expect("JSON");
    well_formed(&json);
    Said { nulls: nulls(&json), json, model: done.model }
}

impl Said {
    pub fn verdict(&self) -> &str {
        self.json["verdict"].as_str().expect("a verdict")
    }

    /// The findings, without those that are not identifiable.
    pub fn findings(&self) -> Vec<&Value> {
        let all = self.json["findings"].as_array().expect("findings");
        all.iter().filter(|f| f["status"] != "not-identifiable").collect()
    }

    /// Name of the first finding; its status where it has none; "" where there is none.
    pub fn first(&self) -> &str {
        let findings = self.findings();
        findings.first().map_or("", |f| f["effect"].as_str().or(f["status"].as_str()).unwrap_or(""))
    }

    /// Largest probability of a name, with the name.
    pub fn surest(&self) -> (f64, String) {
        let all = self.findings();
        let names = all.iter().filter_map(|f| f["alternatives"].get(0));
        let of = |a: &Value| (a["probability"].as_f64().unwrap_or(0.0), text(&a["effect"]));
        names.map(of).fold((0.0, String::new()), |best, a| if a.0 > best.0 { a } else { best })
    }

    /// One-line summary for people.
    pub fn line(&self) -> String {
        let one = |f: &&Value| {
            let name = f["effect"].as_str().or(f["status"].as_str()).unwrap_or("");
            let p = f["alternatives"][0]["probability"].as_f64().unwrap_or(0.0);
            let share = f["share"].as_f64().unwrap_or(0.0);
            let (statistic, axis) = (text(&f["statistic"]), text(&f["axis"]));
            format!("{name} [{statistic}/{axis} {share:.2}, {p:.2}]")
        };
        let all: Vec<String> = self.findings().iter().map(one).collect();
        format!("{}: {}", self.verdict(), all.join(", "))
    }
}

pub fn text(value: &Value) -> String {
    value.as_str().unwrap_or("").to_string()
}

/// Paths of unexpected nulls. JSON has no NaN, so a missing number is null; that may be only a standard
/// error, a name, a next view, the score of held-out views and results of tests not made.
pub fn nulls(d: &Value) -> Vec<String> {
    fn walk(value: &Value, path: &str, found: &mut Vec<String>) {
        const MAY: [&str; 7] = [
            "std_error",
            "effect",
            "next_view",
            "heldout",
            "probability",
            "p_adjusted",
            "replicated",
        ];
        match value {
            Value::Null if !MAY.iter().any(|m| path.ends_with(m)) => found.push(path.into()),
            Value::Array(all) => {
                all.iter().enumerate().for_each(|(k, v)| walk(v, &format!("{path}/{k}"), found));
            }
            Value::Object(map) => {
                map.iter().for_each(|(k, v)| walk(v, &format!("{path}/{k}"), found));
            }
            _ => {}
        }
    }
    let mut found = Vec::new();
    walk(d, "", &mut found);
    found
}

/// Checks the fields, words and ranges of `diagnosis.json`.
#[track_caller]
pub fn well_formed(d: &Value) {
    assert_eq!(d["format"], "kinoise-diagnosis/1");
    let verdict = text(&d["verdict"]);
    assert!(["match", "mismatch", "inconclusive"].contains(&verdict.as_str()), "{verdict}");
    let (mut shares, mut found) = (0.0, 0);
    for f in d["findings"].as_array().expect("findings") {
        let status = text(&f["status"]);
        let known = ["named", "one-of", "unexplained", "recalibrate", "not-identifiable"];
        assert!(known.contains(&status.as_str()), "{status}");
        found += usize::from(status != "not-identifiable");
        let named = f["effect"].is_string();
        assert_eq!(named, ["named", "one-of", "not-identifiable"].contains(&status.as_str()));
        let chance = |v: &Value| v.as_f64().is_some_and(|p| (0.0..=1.0 + 1e-9).contains(&p));
        let alternatives = f["alternatives"].as_array().expect("alternatives");
        // Null where no test gave one.
        let p: Vec<f64> = alternatives.iter().filter_map(|a| a["probability"].as_f64()).collect();
        assert!(p.iter().sum::<f64>() <= 1.0 + 1e-9 && p.iter().all(|p| *p >= 0.0), "{p:?}");
        assert!(p.windows(2).all(|w| w[0] >= w[1]), "best first: {p:?}");
        if status == "one-of" {
            assert!(alternatives.len() > 1, "one of one: {f}");
        }
        if status == "named" || status == "one-of" {
            assert_eq!(alternatives[0]["effect"], f["effect"], "the first is the best");
        }
        assert!(f["p_adjusted"].is_null() || chance(&f["p_adjusted"]), "{f}");
        assert!(chance(&f["share"]), "{f}");
        let [low, high] = [0, 1].map(|k| f["interval"][k].as_f64().expect("an end"));
        assert!(low <= high, "{low} to {high}");
        for size in ["mm", "sigma"] {
            assert!(f["size"][size].as_f64().is_some_and(|s| s >= 0.0), "{f}");
        }
        assert!(f["physics"].as_str().is_some_and(|s| s.len() > 20), "{f}");
        for (name, value) in f["parameters"].as_object().expect("parameters") {
            let e = &value["std_error"];
            assert!(e.is_null() || e.as_f64().is_some_and(|e| e >= 0.0), "{name}: {value}");
        }
        shares += f["share"].as_f64().expect("a share");
    }
    assert!(found == 0 || (shares - 1.0).abs() < 1e-6, "shares sum to {shares}");
    assert_eq!(verdict == "mismatch", found > 0, "{verdict} with {found} findings");
}

/// Changes the text of a file.
#[track_caller]
pub fn edit(path: &Path, change: impl Fn(&str) -> String) {
    let old = fs::read_to_string(path).expect("text");
    let new = change(&old);
    assert_ne!(old, new, "{} was to be changed", path.display());
    fs::write(path, new).expect("written");
}

/// Folders of the views, in name order.
pub fn views(recording: &Path) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = fs::read_dir(recording)
        .expect("a folder")
        .map(|e| e.expect("an entry").path())
        .filter(|p| p.is_dir())
        .collect();
    all.sort();
    all
}

/// Rewrites every depth image of a recording; `change` gets the view's index and the frame.
pub fn repaint(recording: &Path, change: impl Fn(usize, &mut kinoise::Frame)) {
    for (k, view) in views(recording).iter().enumerate() {
        for image in fs::read_dir(view.join("depth")).expect("depth") {
            let path = image.expect("an entry").path();
            let mut frame = read_depth(&path);
            change(k, &mut frame);
            crate::common::write_depth(&path, &frame);
        }
    }
}

pub fn read_depth(path: &Path) -> kinoise::Frame {
    let size = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).expect("a file")))
        .read_info()
        .expect("a header")
        .info()
        .size();
    kinoise::io::FrameSource::new(size.0 as usize, size.1 as usize).read(path).expect("an image")
}
