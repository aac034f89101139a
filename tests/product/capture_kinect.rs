//! `kinoise capture` from a Kinect: a speckle-simulated dump through the C interface of Debian's fakenect,
//! and a mock of libfreenect for what fakenect lacks.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command as Process;
use std::sync::OnceLock;

use kinoise::io::{Assumed, open};
use kinoise::simulate::speckle::Causes;
use kinoise::simulate::{Physics, Scenery, Shoot, kinect_v1, plan_grid};
use kinoise::{DepthCode, Recording, Seed};

use crate::common;
use crate::common::capture::{FRAMES, HELD_STILL, HOLD, folder, frames_of, json, told};
use crate::common::{BOARD, grid, kinoise, write_dump};

/// A file of the package libfreenect0.5; `None`, with a printed remedy, if it is not installed.
fn installed(name: &str) -> Option<PathBuf> {
    let machines = fs::read_dir("/usr/lib").into_iter().flatten().flatten();
    let found = machines.map(|m| m.path().join(name)).find(|p| p.is_file());
    if found.is_none() {
        println!(
            "skipped: no {name} below /usr/lib; ./run setup (or apt-get install libfreenect0.5) brings it"
        );
    }
    found
}

const STAND_IN: &str = "fakenect/libfreenect.so.0.5";

/// `./run test` installs the package wherever it can; there no test may be skipped.
#[test]
fn the_stand_in_is_there_where_it_can_be() {
    if Path::new("/usr/bin/dpkg-query").exists() {
        assert!(
            installed(STAND_IN).is_some(),
            "run ./run setup, or apt-get install libfreenect0.5"
        );
    }
}

/// Nine speckle-simulated views at fakenect's 640 x 480 px, and the same as a dump; made once.
struct ByLight {
    recording: Recording,
    dump: PathBuf,
}

fn by_light() -> &'static ByLight {
    static MADE: OnceLock<(tempfile::TempDir, ByLight)> = OnceLock::new();
    &MADE
        .get_or_init(|| {
            let folder = folder();
            let poses = grid(&[1.0, 1.5, 2.0], &[0.0, 30.0, 60.0]).views();
            let shoot = Shoot {
                sensor: kinect_v1(1),
                views: plan_grid(&poses, &Scenery::bare(BOARD), HELD_STILL, false, Seed(3)),
                physics: Physics::Speckle { causes: Causes::default() },
                infrared: false,
                seed: Seed(3),
            };
            let root = folder.path().join("simulated");
            shoot.write_quickly(&root, &|_, _| ()).expect("written");
            let recording = open(&root, &Assumed::default()).expect("a recording");
            let dump = folder.path().join("dump");
            let frames = frames_of(&recording);
            let stamped = frames.iter().enumerate().map(|(k, f)| (1e9 + k as f64 / 30.0, f));
            write_dump(&dump, stamped);
            (folder, ByLight { recording, dump })
        })
        .1
}

/// The capture command on a dump, with the dump's sensor given by options.
fn from_dump(library: &Path, dump: &Path, output: &Path) -> assert_cmd::Command {
    let DepthCode::Disparity { offset, slope, .. } = by_light().recording.sensor.code else {
        panic!("by light there are raw words")
    };
    let mut command = kinoise();
    command
        .args([
            "capture", "--source", "freenect", "--plain", "--json", "--frames", "4", "--hold", "2",
        ])
        .args(["--distances", "1,1.5,2", "--tilts", "0,30,60"])
        .args(["--intrinsics", "580,580,319.5,239.5", "--raw-disparity"])
        .arg(format!("{offset},{slope}"))
        .arg("--library")
        .arg(library)
        .arg(output)
        .env("FAKENECT_PATH", dump);
    command
}

/// The captured frames equal the dumped ones bit for bit, view by view; the recording calibrates to the
/// board's true distances and can be diagnosed.
#[test]
fn a_dump_by_light_is_captured_calibrated_and_diagnosed() {
    let Some(library) = installed(STAND_IN) else { return };
    let (made, folder) = (by_light(), folder());
    let output = folder.path().join("rec");
    let done = from_dump(&library, &made.dump, &output).assert().success();
    let said = json(&done);
    assert_eq!(said["ending"], "complete");
    assert_eq!(said["views"].as_array().map(Vec::len), Some(9), "{said}");
    let captured = open(&output, &Assumed::default()).expect("a recording");
    assert!(captured.remarks.is_empty() && captured.excluded.is_empty());
    let shot = frames_of(&made.recording);
    for view in &captured.views {
        assert_eq!(view.depth.len(), FRAMES, "{}", view.name);
        assert!(view.depth.windows(2).all(|w| w[1].timestamp > w[0].timestamp));
    }
    for (k, frames) in frames_of(&captured).chunks(FRAMES).enumerate() {
        // The views are in grid order, and so are their names. A view begins with the second still frame.
        let from = k * HELD_STILL + HOLD - 1;
        assert!(frames == &shot[from..from + FRAMES], "{}", captured.views[k].name);
    }
    let out = folder.path().join("model");
    let calibrated = kinoise()
        .args(["calibrate", "--json", "--form", "khoshelham", "-o"])
        .args([&out, &output])
        .assert()
        .success();
    let views = json(&calibrated)["views"].as_array().expect("views").clone();
    assert_eq!(views.len(), 9);
    for (view, z) in views.iter().zip([1.0, 1.0, 1.0, 1.5, 1.5, 1.5, 2.0, 2.0, 2.0]) {
        // The speckle simulation biases the depth by some millimetres.
        let measured = view["axis_distance_m"].as_f64().expect("a distance");
        assert!((measured - z).abs() < 0.01 * z, "{} {measured}", view["view"]);
    }
    let diagnosed = kinoise()
        .args(["diagnose", "--json", "--model"])
        .arg(out.join("model.json"))
        .arg("-o")
        .args([&folder.path().join("diagnosis"), &output])
        .assert();
    let code = diagnosed.get_output().status.code();
    assert!(matches!(code, Some(0 | 1)), "{}", told(&diagnosed));
}

/// The dump ends in the middle of a view, as when the cable is pulled; capture resumes with the whole dump.
#[test]
fn an_unplugged_sensor_loses_nothing_that_was_finished_and_the_same_command_goes_on() {
    let Some(library) = installed(STAND_IN) else { return };
    let (made, folder) = (by_light(), folder());
    let (dump, output) = (folder.path().join("dump"), folder.path().join("rec"));
    common::copy_tree(&made.dump, &dump);
    let index = fs::read_to_string(dump.join("INDEX.txt")).expect("an index");
    let lines: Vec<&str> = index.lines().collect();
    let head = |n: usize| lines[..n].join("\n") + "\n";
    // Two and a half views.
    fs::write(dump.join("INDEX.txt"), head(2 * HELD_STILL + 3)).expect("written");
    let ended = from_dump(&library, &dump, &output).assert().code(2);
    assert!(told(&ended).contains("no more frames"), "{}", told(&ended));
    assert_eq!(json(&ended)["views"].as_array().map(Vec::len), Some(2));
    assert!(!output.join(".partial").exists());
    // The next file is truncated: fakenect would read beyond its end.
    fs::write(dump.join("INDEX.txt"), &index).expect("written");
    let cut = dump.join(lines[4 * HELD_STILL + 1]);
    let bytes = fs::read(&cut).expect("read");
    fs::write(&cut, &bytes[..bytes.len() / 2]).expect("written");
    let damaged = from_dump(&library, &dump, &output).assert().code(2);
    assert!(told(&damaged).contains("cut short"), "{}", told(&damaged));
    assert_eq!(json(&damaged)["views"].as_array().map(Vec::len), Some(4));
    fs::write(&cut, &bytes).expect("written");
    let done = from_dump(&library, &dump, &output).assert().success();
    assert_eq!(json(&done)["finished"].as_array().map(Vec::len), Some(5));
    let again =
        from_dump(&library, &dump, &output).args(["--retake", "z150-t30"]).assert().success();
    assert_eq!(json(&again)["finished"], serde_json::json!(["z150-t30"]));
    assert_eq!(json(&again)["views"].as_array().map(Vec::len), Some(9));
}

#[test]
fn a_missing_library_a_foreign_one_and_a_missing_dump_say_what_to_do() {
    let folder = folder();
    let output = folder.path().join("rec");
    let capture = |library: &Path| {
        let mut command = kinoise();
        command.args(["capture", "--source", "freenect", "--plain", "--library"]);
        command.args([library, &output]).env_remove("FAKENECT_PATH");
        told(&command.assert().code(2))
    };
    let missing = capture(Path::new("/nowhere/libfreenect.so"));
    assert!(missing.contains("apt-get install libfreenect0.5"), "{missing}");
    assert_eq!(missing.trim().lines().count(), 1, "{missing}");
    if let Some(foreign) = installed("libc.so.6") {
        assert!(capture(&foreign).contains("it has no freenect_init"));
    }
    if let Some(library) = installed(STAND_IN) {
        assert!(capture(&library).contains("FAKENECT_PATH"));
        let mut command = kinoise();
        command.args(["capture", "--source", "freenect", "--plain", "--library"]);
        command.args([&library, &output]).env("FAKENECT_PATH", folder.path());
        assert!(told(&command.assert().code(2)).contains("INDEX.txt"));
    }
    assert!(!output.exists(), "nothing was begun");
}

/// Assumes that no Kinect is connected to the test machine.
#[test]
fn without_a_sensor_the_real_library_says_so() {
    let Some(library) = installed("libfreenect.so.0.5") else { return };
    let folder = folder();
    let mut command = kinoise();
    command.args(["capture", "--source", "freenect", "--plain", "--patience", "1", "--library"]);
    let said = told(&command.args([&library, &folder.path().join("rec")]).assert().code(2));
    assert!(said.contains("no Kinect is connected") || said.contains("USB"), "{said}");
}

/// The library built from `tests/data/freenect_mock.c`, once; `None` without a C compiler.
fn mock() -> Option<&'static Path> {
    static MADE: OnceLock<Option<(tempfile::TempDir, PathBuf)>> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let folder = folder();
        let library = folder.path().join("libmock.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/freenect_mock.c");
        let compiled =
            Process::new("cc").args(["-shared", "-fPIC", "-o"]).args([&library, &source]).status();
        if !compiled.is_ok_and(|status| status.success()) {
            println!("skipped: no C compiler (cc) to make the mock of libfreenect with");
            return None;
        }
        Some((folder, library))
    });
    made.as_ref().map(|(_, library)| library.as_path())
}

fn from_mock(library: &Path, output: &Path, frames: &str, then: &str) -> assert_cmd::Command {
    let mut command = kinoise();
    command
        .args(["capture", "--source", "freenect", "--plain", "--json", "--views", "any"])
        .args(["--frames", "4", "--hold", "2", "--patience", "1", "--library"])
        .args([library, output])
        .env("MOCK_FRAMES", frames)
        .env("MOCK_THEN", then);
    command
}

/// Serial number, factory calibration and infrared, which fakenect lacks.
#[test]
fn a_units_own_serial_calibration_and_infrared_are_recorded() {
    let Some(library) = mock() else { return };
    let folder = folder();
    let output = folder.path().join("rec");
    let ended = from_mock(library, &output, "20", "gone").assert().code(2);
    assert!(told(&ended).contains("the Kinect is gone"), "{}", told(&ended));
    let recording = open(&output, &Assumed::default()).expect("a recording");
    assert_eq!(recording.sensor.serial.as_deref(), Some("A00366802050045A"));
    assert!((recording.sensor.camera.fx - 575.8).abs() < 0.05);
    // libfreenect's own table gives 10 (m 120/(7.5 - m) + 120) mm with m = -25.375 * .1042 for word 700.
    let z = recording.sensor.code.metres(700).expect("a depth");
    assert!((z - 0.8872).abs() < 0.0001, "{z}");
    let view = &recording.views[0];
    assert_eq!((view.depth.len(), view.infrared.len()), (4, 4));
    assert_eq!(view.depth[0].timestamp, view.infrared[0].timestamp);
    let infrared =
        kinoise::io::read_infrared(&view.infrared[0].path, [640, 480]).expect("an image");
    assert_eq!((infrared.width, infrared.height), (640, 480));
    // The middle 480 of 488 rows; every row holds its number.
    assert_eq!((infrared.raw[0], infrared.raw[640 * 479]), (4, 483));
    let now = recording.views[0].depth[0].timestamp;
    assert!(now > 1.7e9, "seconds since 1970: {now}");
}

#[test]
fn a_silent_sensor_a_missing_one_and_another_one_are_told() {
    let Some(library) = mock() else { return };
    let folder = folder();
    let output = folder.path().join("rec");
    let none = from_mock(library, &output, "0", "none").assert().code(2);
    assert!(told(&none).contains("no Kinect is connected"), "{}", told(&none));
    let other = from_mock(library, &output, "9", "gone").args(["--serial", "B0"]).assert().code(2);
    assert!(told(&other).contains("but A00366802050045A"), "{}", told(&other));
    let stalled = from_mock(library, &output, "1", "silent").assert().code(2);
    assert!(told(&stalled).contains("no frame for 1 s"), "{}", told(&stalled));
}
