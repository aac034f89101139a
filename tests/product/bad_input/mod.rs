//! Bad input to the real program: either one message and exit code 2, or a reported exclusion and the rest
//! used. Never a panic, a NaN or infinity in the results, or half a result.

use std::fs;
use std::path::{Path, PathBuf};

use kinoise::Frame;
use png::{BitDepth, ColorType};
use proptest::prelude::*;

use crate::common;
use crate::common::{copy_tree, good, grid, kinoise, shots, write_depth, write_png};

mod damage;
mod description;
mod images;
mod options;
mod tables;
mod views;

/// A copy of the good recording (or other input) to damage, and the output folder.
struct Bench {
    folder: tempfile::TempDir,
    recording: PathBuf,
}

impl Bench {
    fn empty() -> Self {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder");
        let recording = folder.path().join("recording");
        Bench { folder, recording }
    }

    fn good() -> Self {
        let bench = Bench::empty();
        copy_tree(good(), &bench.recording());
        bench
    }

    /// A good recording of the given poses.
    fn of(distances_m: &[f64], tilts_deg: &[f64]) -> Self {
        let bench = Bench::empty();
        shots(grid(distances_m, tilts_deg), 2, 3)
            .write(&bench.recording(), &|_, _| ())
            .expect("written");
        bench
    }

    fn recording(&self) -> PathBuf {
        self.recording.clone()
    }

    fn file(&self, name: &str) -> PathBuf {
        self.recording().join(name)
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Changes the text of a file of the recording.
    fn edit(&self, name: &str, change: impl Fn(&str) -> String) -> &Self {
        let path = self.file(name);
        let text = fs::read_to_string(&path).expect("text");
        let changed = change(&text);
        assert_ne!(text, changed, "{name} was to be changed");
        fs::write(path, changed).expect("written");
        self
    }

    fn put(&self, name: &str, bytes: impl AsRef<[u8]>) -> &Self {
        let path = self.file(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, bytes).expect("written");
        self
    }

    fn calibrate(&self) -> Run {
        self.calibrate_with(&[])
    }

    fn calibrate_with(&self, options: &[&str]) -> Run {
        self.run("calibrate", &self.recording(), options)
    }

    /// Runs `fit`, and asserts that `calibrate` does the same with a table.
    fn fit(&self, table: &str) -> Run {
        let path = self.folder.path().join("table.csv");
        fs::write(&path, table).expect("written");
        let [fit, calibrate] = ["fit", "calibrate"].map(|c| self.run(c, &path, &[]));
        assert_eq!((&fit.code, &fit.stdout), (&calibrate.code, &calibrate.stdout));
        assert_eq!(fit.stderr, calibrate.stderr);
        fit
    }

    fn run(&self, command: &str, input: &Path, options: &[&str]) -> Run {
        self.run_to(command, input, &self.out(), options)
    }

    fn run_to(&self, command: &str, input: &Path, out: &Path, options: &[&str]) -> Run {
        let output = kinoise()
            .arg(command)
            .arg(input)
            .arg("-o")
            .arg(out)
            .arg("--json")
            .args(options)
            .output()
            .expect("the program runs");
        Run {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).expect("text"),
            stderr: String::from_utf8(output.stderr).expect("text"),
            out: out.to_path_buf(),
        }
    }
}

/// A finished run of the program.
struct Run {
    code: Option<i32>,
    stdout: String,
    stderr: String,
    out: PathBuf,
}

impl Run {
    /// Asserts exit code 2, a single message with all `needles` and a remedy, and no model.
    #[track_caller]
    fn fails(&self, needles: &[&str]) {
        assert_eq!(self.code, Some(2), "{}", self.stderr);
        let messages: Vec<&str> =
            self.stderr.lines().filter(|l| l.starts_with("kinoise: ")).collect();
        let [message] = messages[..] else { panic!("one message expected: {}", self.stderr) };
        assert_eq!(self.stderr.lines().last(), Some(message), "the message comes last");
        for needle in needles {
            assert!(message.contains(needle), "\"{needle}\" is not in: {message}");
        }
        assert!(
            message.contains("; ") || message.contains(": give ") || message.contains("--help"),
            "no remedy in: {message}"
        );
        assert!(self.stdout.is_empty(), "stdout on failure: {}", self.stdout);
        assert!(!self.out.join("model.json").exists(), "a model was left behind");
        self.is_sound();
    }

    /// Asserts exit code 0, JSON on stdout, and all `needles` on stderr.
    #[track_caller]
    fn tells(&self, needles: &[&str]) -> serde_json::Value {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        for needle in needles {
            assert!(self.stderr.contains(needle), "\"{needle}\" is not in: {}", self.stderr);
        }
        assert!(self.out.join("model.json").is_file());
        self.is_sound();
        serde_json::from_str(&self.stdout).expect("stdout is JSON")
    }

    /// Asserts either a success with all `needles` or a clean failure.
    #[track_caller]
    fn fails_or_tells(&self, needles: &[&str]) {
        if self.code == Some(0) {
            self.tells(needles);
        } else {
            self.fails(&[]);
        }
    }

    #[track_caller]
    fn is_sound(&self) {
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        let digits = |token: &&str| token.len() > 20 && token.bytes().all(|b| b.is_ascii_digit());
        assert_eq!(self.stderr.split([' ', '.']).find(digits), None, "too many digits");
        for cause in ["No such file", "Is a directory", "Not a directory", "at line"] {
            let messages = self.stderr.lines().filter(|l| l.starts_with("kinoise: "));
            messages.for_each(|m| assert!(m.matches(cause).count() < 2, "{cause} twice: {m}"));
        }
        for name in ["model.json", "measurements.csv", "report.html", "sigma.svg", "sigma_map.svg"]
        {
            if let Ok(text) = fs::read_to_string(self.out.join(name)) {
                has_only_numbers(name, &text);
            }
        }
        let leftover = fs::read_dir(&self.out).map_or(0, |entries| {
            entries
                .filter(|e| {
                    e.as_ref().is_ok_and(|e| e.file_name().to_string_lossy().ends_with(".tmp"))
                })
                .count()
        });
        assert_eq!(leftover, 0, "temporary files are left behind");
    }
}

#[track_caller]
fn has_only_numbers(name: &str, text: &str) {
    let word = |c: char| c.is_ascii_alphanumeric();
    for token in text.split(|c| !word(c)) {
        assert!(!matches!(token, "NaN" | "nan" | "inf" | "Infinity"), "{token} in {name}");
    }
}

fn used(result: &serde_json::Value) -> usize {
    result["views"].as_array().expect("views").len()
}

const GOOD_TABLE: &str = "z_m,theta_rad,sigma_m\n1,0,0.0019\n1.5,0,0.0035\n2,0,0.006\n3,0,0.014\n";
