//! An effect is one file and one word in a list: a copy of the source gets both, is built, and simulates,
//! finds, reports and corrects an effect that nothing else in it knows.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use kinoise::NoiseModel;
use kinoise::model::Effect;
use serde_json::{Value, json};

const FILE: &str = include_str!("../data/row_ripple.rs");
/// The entry of the list before which the new word is inserted.
const NEXT_WORD: &str = "    radial_disparity_bias::RadialDisparityBias,\n";
const WORD: &str = "    row_ripple::RowRipple,\n";

/// A twelfth of a full-size pixel: the image is four times smaller.
const AMPLITUDE_PX: f64 = 0.02;
const PERIOD_PX: f64 = 30.0;

/// Builds the program with the effect in it. Its dependencies are built once and kept beside the output of
/// `cargo test`.
fn build() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let target = Path::new(env!("CARGO_BIN_EXE_kinoise")).ancestors().nth(2).expect("a target");
    let target = target.join("new-effect");
    let tree = target.join("tree");
    let _ = fs::remove_dir_all(&tree);
    fs::create_dir_all(&tree).expect("made");
    copy(&root.join("src"), &tree.join("src"));
    for name in ["Cargo.toml", "Cargo.lock"] {
        fs::copy(root.join(name), tree.join(name)).expect("copied");
    }
    // The manifest refers to tests and benches.
    symlink(root.join("tests"), tree.join("tests")).expect("linked");
    fs::write(tree.join("src/effects/row_ripple.rs"), FILE).expect("written");
    let list = tree.join("src/effects/mod.rs");
    let words = fs::read_to_string(&list).expect("read");
    assert_eq!(words.matches(NEXT_WORD).count(), 1);
    fs::write(&list, words.replace(NEXT_WORD, &format!("{WORD}{NEXT_WORD}"))).expect("written");
    let status = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()))
        .args([
            "build",
            "--release",
            "--offline",
            "--locked",
            "--bin",
            "kinoise",
            "--manifest-path",
        ])
        .arg(tree.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        .status()
        .expect("cargo runs");
    assert!(status.success());
    target.join("release/kinoise")
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir(to).expect("made");
    for entry in fs::read_dir(from).expect("a folder").map(|e| e.expect("an entry")) {
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy(&from, &to)
        } else {
            fs::copy(&from, &to).map(|_| ()).expect("copied")
        }
    }
}

struct Bench {
    program: PathBuf,
    folder: tempfile::TempDir,
}

impl Bench {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the program; exit code 1 is a mismatch.
    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(&self.program);
        let output =
            command.args(arguments).current_dir(self.folder.path()).output().expect("runs");
        let code = output.status.code();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(matches!(code, Some(0 | 1)), "{arguments:?}: {code:?}\n{errors}");
        output
    }

    fn diagnose(&self, recording: &str, model: &str, to: &str) -> Value {
        self.run(&["diagnose", recording, "--model", model, "-o", to]);
        let text = fs::read_to_string(self.path(to).join("diagnosis.json")).expect("read");
        serde_json::from_str(&text).expect("JSON")
    }

    /// Writes the paper's Eq. 1 with these effects.
    fn model(&self, name: &str, effects: Vec<Effect>) {
        let model = NoiseModel { effects, ..NoiseModel::paper() };
        model.write(&self.path(name)).expect("written");
    }
}

fn effects(diagnosis: &Value) -> Vec<&str> {
    let findings = diagnosis["findings"].as_array().expect("findings");
    findings.iter().filter_map(|f| f["effect"].as_str()).collect()
}

#[test]
fn an_effect_is_one_file_and_one_word() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let bench = Bench { program: build(), folder };

    let catalogue = String::from_utf8(bench.run(&["effects"]).stdout).expect("text");
    assert!(catalogue.contains("row-ripple") && catalogue.contains("height of the hum"));

    let effect = format!("row-ripple:amplitude_px={AMPLITUDE_PX},period_px={PERIOD_PX}");
    let views = ["--distances", "1,1.5,2,3,4", "--tilts", "0,17,34", "--azimuths", "0,90"];
    let scene = ["--shrink", "4", "--wall-target", "--frames", "2", "--effect", &effect];
    bench.run(&[&["simulate", "recording"][..], &views, &scene].concat());

    bench.model("plain.json", Vec::new());
    let found = bench.diagnose("recording", "plain.json", "found");
    let first = &found["findings"][0];
    assert_eq!((&first["effect"], &first["status"]), (&json!("row-ripple"), &json!("named")));
    for (name, expected, tolerance) in
        [("amplitude_px", AMPLITUDE_PX, 0.1), ("period_px", PERIOD_PX, 0.02)]
    {
        let value = first["parameters"][name]["value"].as_f64().expect("a number");
        assert!((value / expected - 1.0).abs() < tolerance, "{name} = {value}, not {expected}");
    }
    let smallest = found["detectable"].as_array().expect("a list");
    let ripple = smallest.iter().find(|d| d["effect"] == "row-ripple").expect("the ripple");
    let least = ripple["minimum"]["amplitude_px"].as_f64().expect("a number");
    assert!(least > 0.0 && least < AMPLITUDE_PX, "{least} px");
    let page = fs::read_to_string(bench.path("found/report.html")).expect("a page");
    assert!(page.contains("a ripple over the rows") && page.contains("height of the hum"));

    // With its formula in the model it is no longer found, and both the shape and the formula correct it.
    let numbers = [("amplitude_px", AMPLITUDE_PX), ("period_px", PERIOD_PX)];
    let parameters = numbers.map(|(name, value)| (name.to_string(), json!(value)));
    let parameters = parameters.into_iter().collect();
    let ripple = Effect { id: "row-ripple".into(), parameters, ..Effect::default() };
    bench.model("formula.json", vec![ripple]);
    let known = bench.diagnose("recording", "formula.json", "known");
    assert!(!effects(&known).contains(&"row-ripple"), "{:?}", effects(&known));
    for (model, to) in [("found/model.json", "by-shape"), ("formula.json", "by-formula")] {
        bench.run(&["correct", "recording", "--model", model, "-o", to]);
        let left = bench.diagnose(to, "plain.json", &format!("{to}-left"));
        let rows = left["findings"].as_array().expect("findings").iter();
        assert_eq!(rows.filter(|f| f["axis"] == "row").count(), 0, "{to}: {:?}", left["findings"]);
    }
}
