//! A working folder with the good recording, in which tests run the program.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::Duration;

use kinoise::simulate::Physics;
use kinoise::simulate::room::{Film, Room, around_the_desks};
use kinoise::{NoiseModel, Seed, SigmaModel};
use serde_json::Value;

use crate::common::{copy_tree, good, kinoise};

pub struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    /// A folder with the good recording in `rec`.
    pub fn new() -> Self {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
        copy_tree(good(), &folder.path().join("rec"));
        Desk { folder }
    }

    /// A folder that also has a short film and a model of Eq. 1.
    pub fn furnished() -> Self {
        let desk = Desk::new();
        desk.film("film", 4);
        desk.model("model.json", |_| ());
        desk
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Depth images of a film, in time order.
    pub fn images(&self, film: &str) -> Vec<PathBuf> {
        let folder = fs::read_dir(self.at(film).join("depth")).expect("images");
        let mut images: Vec<PathBuf> = folder.map(|e| e.expect("one").path()).collect();
        images.sort();
        images
    }

    pub fn put(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.at(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, bytes).expect("written");
    }

    /// Writes the good recording's description with a change.
    pub fn describe(&self, change: impl FnOnce(&mut Value)) {
        let text = fs::read_to_string(good().join("recording.json")).expect("text");
        let mut value: Value = serde_json::from_str(&text).expect("JSON");
        change(&mut value);
        self.put("rec/recording.json", format!("{value:#}"));
    }

    /// Runs a command in the folder; a run that hangs is stopped and has no exit code.
    pub fn run(&self, line: &str) -> Output {
        let words = line.split_whitespace();
        kinoise()
            .current_dir(self.folder.path())
            .args(words)
            .timeout(Duration::from_secs(20))
            .output()
            .expect("the program runs")
    }

    #[track_caller]
    pub fn refused(&self, line: &str, needles: &[&str]) {
        let output = self.run(line);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{line}: {stderr}");
        let message = stderr.lines().last().unwrap_or_default();
        assert!(message.starts_with("kinoise: "), "{line}: {stderr}");
        assert!(stderr.len() < 5000, "{line}: {} bytes", stderr.len());
        for needle in needles {
            assert!(message.contains(needle), "{line}: {needle}: {message}");
        }
    }

    #[track_caller]
    pub fn done(&self, line: &str) -> String {
        let output = self.run(line);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{line}: {stderr}");
        stderr
    }

    /// Writes a film of the office.
    pub fn film(&self, name: &str, frames: usize) {
        let film = Film {
            sensor: Film::kinect(4),
            room: Room::office(Seed(1)),
            poses: around_the_desks().into_iter().take(frames).collect(),
            physics: Physics::Formula { sigma: SigmaModel::paper(), effects: Vec::new() },
            seed: Seed(1),
        };
        film.write(&self.at(name), &|_, _| ()).expect("written");
    }

    /// Writes Eq. 1 as a model file with a change.
    pub fn model(&self, name: &str, change: impl FnOnce(&mut Value)) {
        let text = NoiseModel::paper().to_json().expect("a model");
        let mut model: Value = serde_json::from_str(&text).expect("JSON");
        change(&mut model);
        self.put(name, format!("{model:#}"));
    }
}

#[cfg(unix)]
pub fn fifo(path: &Path) {
    let made = std::process::Command::new("mkfifo").arg(path).status().expect("mkfifo");
    assert!(made.success());
}
