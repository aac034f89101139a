//! No plausible nonsense: impossible input is refused or reported, in every command alike.

use std::fs;
use std::path::{Path, PathBuf};

use kinoise::frame::KINECT_NO_MEASUREMENT;
use kinoise::io::{Assumed, open};
use kinoise::simulate::{Shoot, kinect_v1};
use kinoise::{DepthCode, Sensor, sequence};
use nalgebra::{Isometry3, Vector3};

use crate::common::{BOARD, copy_tree, data, good, grid, kinoise, truth, write_depth};

const DISPARITY: DepthCode = DepthCode::Disparity {
    offset: 3.330_949_516_1,
    slope: -0.003_071_101_6,
    invalid: KINECT_NO_MEASUREMENT,
};
const MILLIMETRES: DepthCode = DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 };
const INTRINSICS: &str = "--intrinsics 145,145,79.5,59.5";

struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder");
        Desk { folder }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a recording of 160 x 120 px in this code.
    fn recording(&self, name: &str, code: DepthCode, distances_m: &[f64]) -> PathBuf {
        let sensor = Sensor { code, ..kinect_v1(4) };
        let poses = grid(distances_m, &[0.0, 30.0, 60.0]).views();
        Shoot::plain(sensor, BOARD, &poses, 1, truth(), kinoise::Seed(5))
            .write(&self.at(name), &|_, _| ())
            .expect("written");
        self.at(name)
    }

    /// Writes the images of such a recording alone.
    fn plain(&self, name: &str, code: DepthCode, distances_m: &[f64]) {
        let recording = self.recording(&format!("{name}-recording"), code, distances_m);
        fs::create_dir(self.at(name)).expect("made");
        for view in open(&recording, &Assumed::default()).expect("opens").views {
            let image = self.at(name).join(format!("{}.png", view.name));
            fs::copy(&view.depth[0].path, image).expect("copied");
        }
    }

    fn run(&self, line: &str) -> (Option<i32>, String) {
        let output =
            kinoise().current_dir(self.folder.path()).args(line.split(' ')).output().expect("runs");
        (output.status.code(), String::from_utf8(output.stderr).expect("text"))
    }

    #[track_caller]
    fn done(&self, line: &str, needles: &[&str]) {
        let (code, said) = self.run(line);
        assert!(matches!(code, Some(0 | 1)), "{line}: {said}");
        needles.iter().for_each(|n| assert!(said.contains(n), "{line}: \"{n}\" is not in: {said}"));
    }

    /// Asserts exit code 2, a message with all of `needles`, and no model.
    #[track_caller]
    fn refused(&self, line: &str, needles: &[&str]) {
        let (code, said) = self.run(line);
        assert_eq!(code, Some(2), "{line}: {said}");
        needles.iter().for_each(|n| assert!(said.contains(n), "{line}: \"{n}\" is not in: {said}"));
        assert!(!self.at("out/model.json").exists(), "{line}");
    }
}

fn distance_of(folder: &Path) -> f64 {
    let text = fs::read_to_string(folder.join("measurements.csv")).expect("read");
    let z = text.lines().next().and_then(|l| l.split(',').position(|c| c == "z_m")).expect("z_m");
    let cell = |line: &str| line.split(',').nth(z).and_then(|c| c.parse::<f64>().ok());
    text.lines().skip(1).filter_map(cell).fold(0.0, f64::max)
}

// ---- how raw values become metres ------------------------------------------------------------

#[test]
fn raw_words_are_known_by_their_code_and_never_read_as_lengths() {
    let desk = Desk::new();
    desk.plain("raw", DISPARITY, &[1.0, 1.5, 2.0, 3.0]);
    desk.done(&format!("calibrate raw {INTRINSICS} -o told"), &["2047", "raw Kinect disparities"]);
    let farthest = distance_of(&desk.at("told"));
    assert!((2.9..3.6).contains(&farthest), "{farthest} m");
    desk.done("calibrate raw-recording -o cal", &[]);
    for unit in ["1000", "5000"] {
        for line in [
            "calibrate raw -o out",
            "diagnose raw -o out",
            "diagnose raw --model cal/model.json -o out",
            "correct raw --model cal/model.json -o out",
            "capture out --source play:raw --views any",
            "capture out --source folder:raw --views any --patience 1",
        ] {
            let line = format!("{line} {INTRINSICS} --units-per-metre {unit}");
            desk.refused(&line, &["2047", "raw disparities", "--raw-disparity"]);
        }
    }
    let description = desk.at("raw-recording/recording.json");
    let text = fs::read_to_string(&description).expect("read");
    let mut lie: serde_json::Value = serde_json::from_str(&text).expect("json");
    lie.as_object_mut().expect("an object").remove("raw_disparity");
    lie["units_per_metre"] = 1000.0.into();
    fs::write(&description, lie.to_string()).expect("written");
    for line in ["calibrate raw-recording -o out", "simulate out --like raw-recording"] {
        desk.refused(line, &["2047", "in place of units_per_metre"]);
    }
}

#[test]
fn a_plain_folder_whose_unit_stays_open_needs_it() {
    let desk = Desk::new();
    desk.plain("near", MILLIMETRES, &[1.0, 1.5, 2.0, 3.0]);
    desk.plain("far", MILLIMETRES, &[2.0, 2.5, 3.0, 4.0]);
    desk.plain("tum", kinect_v1(4).code, &[1.0, 1.5, 2.0, 3.0]);
    for folder in ["far", "tum"] {
        for command in ["calibrate", "diagnose"] {
            let line = format!("{command} {folder} {INTRINSICS} -o out");
            desk.refused(&line, &["leave it open", "--units-per-metre (1000 = mm, 5000 = TUM)"]);
        }
    }
    let line = format!("calibrate near {INTRINSICS} -o near-out");
    desk.done(&line, &["depth taken as millimetres", "at 5000 a metre the nearest image"]);
    desk.done(&format!("calibrate tum {INTRINSICS} --units-per-metre 5000 -o tum-out"), &[]);
    // Given but improbable: reported.
    let line = format!("calibrate near {INTRINSICS} --units-per-metre 5000 -o wrong");
    let (_, said) = desk.run(&line);
    assert!(said.contains("check --units-per-metre"), "{said}");
    // Lengths are no disparities.
    let line = format!("calibrate tum {INTRINSICS} --raw-disparity 3.33,-0.00307 -o out");
    desk.refused(&line, &["11 bits", "--units-per-metre"]);
}

/// The second unit's words read as lengths once gave "0.85 mm at 0.84 m" with exit code 0.
#[test]
fn the_second_unit_is_read_as_what_it_is() {
    let Some(unit) = data("kinect-v1-second-unit") else { return };
    let desk = Desk::new();
    let line = format!("calibrate {} --intrinsics 585,585,319.5,239.5 -o", unit.display());
    for options in ["--units-per-metre 1000", "--units-per-metre 5000"] {
        desk.refused(&format!("{line} out {options}"), &["raw disparities of a Kinect v1"]);
    }
    desk.done(&format!("{line} out"), &["raw Kinect disparities"]);
    let farthest = distance_of(&desk.at("out"));
    assert!((3.0..4.0).contains(&farthest), "{farthest} m");
}

/// Real images in millimetres and in 5000 per metre reveal their unit by a Kinect's steps; the other unit is
/// reported.
#[test]
fn the_steps_of_real_kinects_tell_their_unit() {
    let assumed = |units: Option<f64>| Assumed {
        intrinsics: Some([585.0, 585.0, 319.5, 239.5]),
        code: units.map(|units_per_metre| DepthCode::Metric { units_per_metre, invalid: 0 }),
        ..Assumed::default()
    };
    for (name, part, unit, other) in [
        ("sevenscenes_a", ".depth.png", 1000.0, 5000.0),
        ("tum_fr1_rpy_a/depth", ".png", 5000.0, 1000.0),
        ("mit-tabletop-kinect", ".png", 1000.0, 5000.0),
    ] {
        let Some(from) = data(name) else { return };
        let desk = Desk::new();
        let files = fs::read_dir(from).expect("a folder").map(|e| e.expect("an entry").path());
        let mut images: Vec<PathBuf> =
            files.filter(|f| f.to_string_lossy().ends_with(part)).collect();
        images.sort();
        for image in images.iter().step_by(images.len().div_ceil(12)) {
            fs::copy(image, desk.at(&image.file_name().expect("a name").to_string_lossy()))
                .expect("copied");
        }
        let recording = open(desk.folder.path(), &assumed(None)).expect(name);
        let code = DepthCode::Metric { units_per_metre: unit, invalid: 0 };
        assert_eq!(recording.sensor.code, code, "{name}: {:?}", recording.remarks);
        assert!(recording.remarks.iter().any(|r| r.contains("steps as a Kinect's")), "{name}");
        let recording = open(desk.folder.path(), &assumed(Some(other))).expect(name);
        let told = recording.remarks.iter().any(|r| r.contains("steps as a Kinect's does at"));
        assert!(told, "{name}: {:?}", recording.remarks);
    }
}

// ---- a fit that explains nothing -------------------------------------------------------------

#[test]
fn a_fit_that_explains_nothing_writes_its_page_and_no_model() {
    let desk = Desk::new();
    let sigmas = [9.0, 1.0, 12.0, 0.5, 7.0, 0.4, 15.0, 0.6, 8.0, 0.9, 11.0, 0.3];
    let mut table = String::from("z_m,theta_rad,sigma_m\n");
    for (k, sigma_mm) in sigmas.iter().enumerate() {
        table +=
            &format!("{},{},{}\n", 1.0 + 0.25 * k as f64, 0.1 * (k % 3) as f64, 1e-3 * sigma_mm);
    }
    fs::write(desk.at("t.csv"), table).expect("written");
    // In the second round the first round's model is there, and would be taken for that of the new page.
    for command in
        ["fit t.csv --form khoshelham -o out", "calibrate t.csv --form khoshelham -o out"]
    {
        let says = ["explains nothing", "no model.json was written", "report.html", "--force"];
        desk.refused(command, &says);
        assert!(desk.at("out/report.html").is_file() && desk.at("out/sigma.svg").is_file());
        desk.done("calibrate t.csv --form khoshelham --force -o out", &["the fit is"]);
        assert!(desk.at("out/model.json").is_file());
    }
}

// ---- the camera ------------------------------------------------------------------------------

#[test]
fn a_camera_that_cannot_be_meant_is_refused_by_every_command() {
    let desk = Desk::new();
    copy_tree(good(), &desk.at("rec"));
    desk.done("calibrate rec -o cal", &[]);
    desk.done("simulate film --room --frames 4 --shrink 4", &[]);
    desk.plain("png", kinect_v1(4).code, &[1.0, 2.0]);
    for (numbers, says) in [
        ("79.5,59.5,145,145", "principal point (145, 145) lies outside the image of 160 x 120"),
        ("145,79.5,145,59.5", "differ by more than a quarter"),
        ("145,145,79.5,-3", "outside the image"),
        ("0.9,0.9,79.5,59.5", "field of view of 178.7"),
        ("14500,14500,79.5,59.5", "field of view of 0.6"),
    ] {
        for line in [
            "calibrate png -o out",
            "diagnose png -o out",
            "correct png --model cal/model.json -o out",
            "capture out --source folder:png --views any --patience 1",
        ] {
            let line = format!("{line} --intrinsics {numbers} --units-per-metre 5000");
            desk.refused(&line, &["--intrinsics", says]);
        }
        let [fx, fy, cx, cy]: [f64; 4] = numbers
            .split(',')
            .map(|n| n.parse().expect("a number"))
            .collect::<Vec<f64>>()
            .try_into()
            .expect("four");
        let spoil = |file: &Path, pointer: &str| {
            let text = fs::read_to_string(file).expect("read");
            let mut json: serde_json::Value = serde_json::from_str(&text).expect("json");
            let sensor = json.pointer_mut(pointer).expect("a sensor");
            for (key, value) in [("fx", fx), ("fy", fy), ("cx", cx), ("cy", cy)] {
                sensor[key] = value.into();
            }
            fs::write(file, json.to_string()).expect("written");
            text
        };
        let spoilt = ["rec/recording.json", "film/recording.json", "cal/model.json"];
        let whole = spoilt.map(|file| {
            let pointer = if file.ends_with("model.json") { "/sensor" } else { "" };
            spoil(&desk.at(file), pointer)
        });
        for line in [
            "calibrate rec -o out",
            "diagnose rec -o out",
            "simulate out --like rec",
            "map film -o out",
            "compare film -o out",
            "simulate out --model cal/model.json",
        ] {
            desk.refused(line, &[says]);
        }
        for (file, text) in spoilt.iter().zip(whole) {
            fs::write(desk.at(file), text).expect("written");
        }
    }
}

/// Every command takes the benchmark's cameras from the comments in the lists.
#[test]
fn a_tum_folder_has_one_camera_for_every_command() {
    let desk = Desk::new();
    let frame = kinoise::Frame { width: 640, height: 480, raw: vec![10_000; 640 * 480] };
    write_depth(&desk.at("depth/1.png"), &frame);
    let write = |head: &str| {
        fs::write(desk.at("depth.txt"), format!("# depth maps\n{head}\n1.0 depth/1.png\n"))
            .expect("written");
        let recording = open(desk.folder.path(), &Assumed::default()).expect("a recording");
        let film = sequence::open(desk.folder.path(), &Assumed::default()).expect("a sequence");
        assert_eq!(recording.sensor, film.sensor, "{head}");
        (recording.sensor.camera, recording.remarks)
    };
    let (camera, remarks) = write("# file: 'rgbd_dataset_freiburg1_rpy.bag'");
    assert_eq!((camera.fx, camera.cy), (517.3, 255.3));
    assert_eq!(camera.distortion.map(|k| k[0]), Some(0.2624));
    assert!(remarks.iter().any(|r| r.contains("freiburg1: its published camera")), "{remarks:?}");
    let (camera, _) = write("# file: 'rgbd_dataset_freiburg2_desk.bag'");
    assert_eq!((camera.fx, camera.distortion.map(|k| k[0])), (520.9, Some(0.2312)));
    let (camera, remarks) = write("# file: 'mine.bag'");
    assert_eq!((camera.fx, camera.distortion), (525.0, None));
    let assumed = "525,525,319.5,239.5 and 5000 units a metre assumed";
    assert!(remarks.iter().any(|r| r.contains(assumed)), "{remarks:?}");
}

#[test]
fn a_model_of_another_resolution_is_refused_by_every_command() {
    let desk = Desk::new();
    copy_tree(good(), &desk.at("rec"));
    desk.done("simulate film --room --frames 4 --shrink 4", &[]);
    desk.done("simulate big --shrink 2 --frames 1 --distances 1,1.5,2,3 --tilts 0,30,60", &[]);
    desk.done("calibrate big -o big-cal", &[]);
    for line in [
        "diagnose rec --model big-cal/model.json -o out",
        "simulate out --like rec --model big-cal/model.json",
        "correct rec --model big-cal/model.json -o out",
        "map film --model big-cal/model.json -o out",
        "compare film --model big-cal/model.json -o out",
    ] {
        desk.refused(line, &["320 x 240", "160 x 120"]);
        assert!(!desk.at("out").exists(), "{line}");
    }
}

// ---- truth and estimate ----------------------------------------------------------------------

#[test]
fn truth_and_estimate_swapped_are_told() {
    let desk = Desk::new();
    let start = Isometry3::new(Vector3::new(1.0, -2.0, 0.7), Vector3::new(0.3, 0.2, -0.9));
    let pose = |t: f64| {
        Isometry3::new(
            Vector3::new(0.3 * t.sin(), 0.1 * t, 0.2 * t * t),
            Vector3::new(0.0, 0.1 * t, 0.0),
        )
    };
    let write = |name: &str, from: Isometry3<f64>, rate: f64| {
        let line = |k: usize| {
            let t = k as f64 / rate;
            let p = from * pose(t);
            let (x, q) = (p.translation.vector, p.rotation);
            format!(
                "{t:.6} {:.6} {:.6} {:.6} {:.6} {:.6} {:.6} {:.6}\n",
                x.x, x.y, x.z, q.i, q.j, q.k, q.w
            )
        };
        let lines: String = (0..(4.0 * rate) as usize).map(line).collect();
        fs::write(desk.at(name), lines).expect("written");
    };
    write("mocap.txt", start, 100.0);
    write("mine.txt", Isometry3::identity(), 30.0);
    write("theirs.txt", start, 30.0);
    const ASK: &str = "are --truth and --estimate swapped?";
    let says = |truth: &str, estimate: &str| {
        let (code, said) = desk.run(&format!("evaluate --truth {truth} --estimate {estimate}"));
        assert_eq!(code, Some(0), "{said}");
        said.contains(ASK)
    };
    assert!(!says("mocap.txt", "mine.txt") && says("mine.txt", "mocap.txt"));
    assert!(!says("mocap.txt", "theirs.txt") && says("theirs.txt", "mocap.txt"));
    assert!(!says("mine.txt", "mine.txt"));
    let output = kinoise()
        .current_dir(desk.folder.path())
        .args(["evaluate", "--truth", "mine.txt", "--estimate", "mocap.txt", "--json"])
        .output()
        .expect("runs");
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("json");
    assert!(json["remarks"][0].as_str().expect("a remark").contains(ASK));
}

/// A model of another camera is reported at once, with the difference; so is the default model.
#[test]
fn a_sequence_says_whose_model_weighs_it() {
    let desk = Desk::new();
    desk.recording("rec", kinect_v1(4).code, &[1.0, 1.5, 2.0, 3.0]);
    desk.done("calibrate rec -o cal", &[]);
    let text = fs::read_to_string(desk.at("cal/model.json")).expect("read");
    let mut other: serde_json::Value = serde_json::from_str(&text).expect("json");
    for key in ["fx", "fy"] {
        other["sensor"][key] = (1.1 * other["sensor"][key].as_f64().expect("a number")).into();
    }
    fs::write(desk.at("other.json"), other.to_string()).expect("written");
    desk.done("simulate film --room --frames 4 -m cal/model.json", &[]);
    for command in ["map film", "compare film", "diagnose rec"] {
        // Four frames are too short for a comparison over a second, but the model is reported before.
        let (_, said) = desk.run(&format!("{command} -m other.json -o out"));
        assert!(
            said.contains("other.json seems to be of another sensor: the model's focal"),
            "{said}"
        );
        let (_, said) = desk.run(&format!("{command} -m cal/model.json -o own"));
        assert!(!said.contains("another sensor"), "{said}");
        for out in ["out", "own"] {
            let _ = fs::remove_dir_all(desk.at(out));
        }
    }
    desk.done("map film -o own", &["no --model was given", "Eq. 1, for a Kinect v1 at 1 to 4 m"]);
}

/// The benchmark publishes its cameras: replacing one is reported.
#[test]
fn intrinsics_in_place_of_a_published_camera_are_told() {
    let desk = Desk::new();
    let frame = kinoise::Frame { width: 640, height: 480, raw: vec![10_000; 640 * 480] };
    write_depth(&desk.at("depth/1.png"), &frame);
    let head = "# file: 'rgbd_dataset_freiburg3_office.bag'";
    fs::write(desk.at("depth.txt"), format!("{head}\n1.0 depth/1.png\n")).expect("written");
    let told = |intrinsics| {
        let assumed = Assumed { intrinsics: Some(intrinsics), ..Assumed::default() };
        let film = sequence::open(desk.folder.path(), &assumed).expect("a sequence");
        assert_eq!(film.sensor.camera.fx, intrinsics[0]);
        film.remarks.iter().any(|r| r.contains("--intrinsics replaces freiburg3's"))
    };
    assert!(told([525.0, 525.0, 319.5, 239.5]));
    assert!(!told([535.4, 539.2, 320.1, 247.6]), "it is the published one");
}

// ---- folders that are something else ---------------------------------------------------------

/// The folder above a recording, and folders written by the tool itself.
#[test]
fn a_folder_that_is_no_recording_says_what_it_is() {
    let desk = Desk::new();
    fs::create_dir(desk.at("set")).expect("made");
    desk.recording("set/rec", kinect_v1(4).code, &[1.0, 1.5, 2.0, 3.0]);
    desk.done("simulate set/film --room --frames 2 --shrink 4", &[]);
    desk.done("calibrate set/rec -o results/cal", &[]);
    let both = ["this folder holds no recording, but film/, rec/ in it do"];
    desk.refused("calibrate set -o out", &both);
    desk.refused("map set -o out", &["film/ in it does", "give that folder"]);
    fs::rename(desk.at("set/film"), desk.at("film")).expect("moved");
    desk.refused("diagnose set -o out", &["but rec/ in it does", "give that folder"]);
    desk.refused("map set/rec -o out", &["a recording of still views, no film"]);
    let written = ["holds results of kinoise calibrate (sigma.svg)", "made of"];
    for command in ["calibrate", "map"] {
        desk.refused(&format!("{command} results/cal -o out"), &written);
    }
    fs::remove_file(desk.at("set/rec/recording.json")).expect("removed");
    desk.refused("calibrate set/rec -o out", &["recording.json is missing beside the views"]);
    let intrinsics = "correct results/cal -m results/cal/model.json -o out --intrinsics 1,1,0,0";
    desk.refused(intrinsics, &written);
}

/// A single view is measured, but gives no model.
#[test]
fn one_view_makes_no_model() {
    let desk = Desk::new();
    desk.recording("rec", kinect_v1(4).code, &[2.0]);
    for view in open(&desk.at("rec"), &Assumed::default()).expect("opens").views.iter().skip(1) {
        fs::remove_dir_all(desk.at("rec").join(&view.name)).expect("removed");
    }
    desk.refused(
        "calibrate rec -o out",
        &["one view is no calibration", "no model.json", "--force"],
    );
    assert!(desk.at("out/measurements.csv").is_file());
    desk.done("calibrate rec -o out --force", &["this is no calibration"]);
    assert!(desk.at("out/model.json").is_file());
}
