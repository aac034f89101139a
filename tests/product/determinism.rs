//! The same seed gives the same bytes, whatever the number of threads.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{copy_tree, good, kinoise, tree, write_depth};

/// Runs the program with the output folder as the last argument; returns its files and stdout.
fn run(arguments: &[&str], threads: &str, seed: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    let output = kinoise()
        .args(arguments)
        .arg(&out)
        .args(["--threads", threads, "--seed", seed])
        .output()
        .expect("the program runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut files = tree(&out);
    files.push(("stdout".into(), output.stdout));
    files
}

#[track_caller]
fn same(a: &[(PathBuf, Vec<u8>)], b: &[(PathBuf, Vec<u8>)]) {
    assert_eq!(a.len(), b.len());
    for ((name, a), (other, b)) in a.iter().zip(b) {
        assert_eq!(name, other);
        assert!(a == b, "{} differs", name.display());
    }
}

fn named<'a>(files: &'a [(PathBuf, Vec<u8>)], name: &str) -> &'a [u8] {
    &files.iter().find(|(n, _)| n == Path::new(name)).expect(name).1
}

#[test]
fn calibrate_gives_the_same_bytes_on_one_thread_and_two() {
    let recording = good().to_str().expect("a plain path");
    let arguments = ["calibrate", recording, "--json", "-o"];
    let one = run(&arguments, "1", "11");
    same(&one, &run(&arguments, "2", "11"));
    same(&one, &run(&arguments, "2", "11"));
    for file in ["model.json", "measurements.csv"] {
        assert!(!named(&one, file).is_empty());
    }
    let model = String::from_utf8_lossy(named(&one, "model.json"));
    assert!(model.contains("2023-11-14T22:13:20Z"), "SOURCE_DATE_EPOCH is the time: {model}");
    assert!(model.contains("\"seed\": 11"));
    // The seed only decides which hypotheses are tried: the surface hardly moves, but the seed is recorded.
    let other = run(&arguments, "2", "12");
    assert_ne!(named(&one, "model.json"), named(&other, "model.json"));
}

#[test]
fn simulate_gives_the_same_bytes_on_one_thread_and_two_and_others_for_another_seed() {
    let arguments = ["simulate", "--shrink", "8", "--frames", "2"];
    let one = run(&arguments, "1", "11");
    same(&one, &run(&arguments, "2", "11"));
    assert_eq!(one.iter().filter(|(n, _)| n.extension().is_some_and(|e| e == "png")).count(), 126);
    let other = run(&arguments, "1", "12");
    assert_eq!(one.len(), other.len());
    let pairs = one.iter().zip(&other);
    let differing =
        pairs.filter(|((n, a), (_, b))| n.extension().is_some_and(|e| e == "png") && a != b);
    assert!(differing.count() > 120, "another seed is another recording");
    assert_eq!(named(&one, "recording.json"), named(&other, "recording.json"));
}

/// Simulation and calibration twice give the same bytes.
#[test]
fn a_model_made_from_a_simulation_of_itself_repeats() {
    let calibrated = || {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let recording = folder.path().join("recording");
        let out = folder.path().join("out");
        for arguments in [
            vec!["simulate", recording.to_str().expect("plain"), "--shrink", "4"],
            vec![
                "calibrate",
                recording.to_str().expect("plain"),
                "-o",
                out.to_str().expect("plain"),
            ],
        ] {
            let output = kinoise().args(&arguments).output().expect("the program runs");
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        }
        ["model.json", "measurements.csv"].map(|n| fs::read(out.join(n)).expect("written"))
    };
    assert_eq!(calibrated(), calibrated());
}

/// Repeats the command by which the bundled recording was made (calib_data/README.md).
#[test]
fn the_bundled_recording_is_what_its_command_makes() {
    let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("calib_data/eq1-paper-grid");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let made = folder.path().join("made");
    kinoise()
        .arg("simulate")
        .arg(&made)
        .args(["--seed", "2016", "--shrink", "2", "--frames", "2"])
        .assert()
        .success();
    same(&tree(&bundled), &tree(&made));
}

/// A mirrored or rotated sensor is no noisier.
#[test]
fn a_mirrored_or_rotated_recording_has_the_same_noise() {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
    let fitted = |turn: fn(usize, usize) -> usize| {
        let root = folder.path().join("rec");
        copy_tree(good(), &root);
        // The principal point is central, so it does not move.
        for (file, _) in
            tree(&root).iter().filter(|(f, _)| f.extension().is_some_and(|e| e == "png"))
        {
            let path = root.join(file);
            let frame = kinoise::io::FrameSource::new(160, 120).read(&path).expect("a frame");
            let raw = (0..frame.raw.len()).map(|i| frame.raw[turn(i % 160, i / 160)]).collect();
            write_depth(&path, &kinoise::Frame { raw, ..frame });
        }
        let recording = kinoise::io::open(&root, &Default::default()).expect("a recording");
        let options =
            kinoise::CalibrateOptions { form: Some(kinoise::Form::Paper), ..Default::default() };
        let measured = kinoise::measure_recording(&recording, &options.measure, &|_, _| ());
        let measured = measured.expect("measured");
        kinoise::model_of(&recording, &measured, &options).expect("a model").model.sigma
    };
    let as_it_is = fitted(|u, v| 160 * v + u);
    for turned in [fitted(|u, v| 160 * v + 159 - u), fitted(|u, v| 160 * (119 - v) + 159 - u)] {
        for (z, theta) in [(1.0, 0.0), (2.0, 0.5), (3.0, 0.0), (1.5, 1.0)] {
            let ratio = turned.sigma(z, theta) / as_it_is.sigma(z, theta);
            assert!((ratio - 1.0).abs() < 1e-3, "{z} m, {theta} rad: {ratio}");
        }
    }
}
