//! Bad input, through the real program: one message and exit code 2, or the exclusion told and
//! the rest used. Never a panic, never a number that is none, never half a result.

use std::fs;
use std::path::{Path, PathBuf};

use kinoise::Frame;
use png::{BitDepth, ColorType};
use proptest::prelude::*;

use crate::common;
use crate::common::{copy_tree, good, grid, kinoise, shots, write_depth, write_png};

/// A copy of the good recording (or anything else) to spoil, and where the results go.
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

    /// A good recording of other poses.
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

    /// Change the text of a file of the recording.
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

    /// `calibrate` does the same with a table.
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
    /// Exit code 2, one message that says all of `needles` and what to do, no model.
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

    /// Exit code 0, JSON on stdout, and all of `needles` told on stderr.
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

    /// Either of the two, as the data decide.
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

// ---- the folder and recording.json -------------------------------------------------------

#[test]
fn the_good_recording_is_good() {
    let result = Bench::good().calibrate().tells(&["12 of 12 views"]);
    assert_eq!(used(&result), common::GOOD_VIEWS);
}

#[test]
fn an_empty_folder() {
    let bench = Bench::empty();
    fs::create_dir(bench.recording()).expect("made");
    bench.calibrate().fails(&["recording", "recording.json", "give the folder"]);
}

#[test]
fn no_such_folder() {
    Bench::empty().calibrate().fails(&["recording", "no such folder"]);
}

#[test]
fn a_recording_without_views() {
    let bench = Bench::empty();
    bench.put("recording.json", fs::read(good().join("recording.json")).expect("read"));
    bench.calibrate().fails(&["recording", "no view", "depth.txt"]);
}

#[test]
fn every_key_of_the_description_is_needed() {
    for key in ["format", "sensor", "width", "height", "fx", "fy", "cx", "cy", "units_per_metre"] {
        let bench = Bench::good();
        bench.edit("recording.json", |text| text.replace(&format!("\"{key}\""), "\"other\""));
        bench.calibrate().fails(&["recording.json", key]);
    }
}

#[test]
fn malformed_json_names_its_line() {
    let bench = Bench::good();
    bench.edit("recording.json", |t| t.replace("\"width\":", "\"width\""));
    let line = fs::read_to_string(bench.file("recording.json"))
        .expect("text")
        .lines()
        .position(|l| l.contains("width"))
        .expect("there")
        + 1;
    bench.calibrate().fails(&["recording.json", &format!("line {line}")]);
    bench.put("recording.json", "").calibrate().fails(&["recording.json"]);
    bench.put("recording.json", [0xff, 0xfe, 0x00]).calibrate().fails(&["recording.json"]);
}

#[test]
fn another_format_is_refused_before_its_keys() {
    let bench = Bench::good();
    bench.edit("recording.json", |t| t.replace("recording/1", "recording/7"));
    bench.calibrate().fails(&["recording.json", "recording/7", "recording/1"]);
    bench.put("recording.json", "{\"format\": \"film/3\"}");
    bench.calibrate().fails(&["recording.json", "film/3", "recording/1"]);
}

#[test]
fn numbers_that_describe_no_camera() {
    for (from, to, says) in [
        ("\"fx\": 145.0", "\"fx\": 0.0", "fx = 0"),
        ("\"fx\": 145.0", "\"fx\": -145.0", "fx = -145"),
        ("\"fx\": 145.0", "\"fx\": 1e999", "line"),
        ("\"fx\": 145.0", "\"fx\": \"145\"", "line"),
        ("\"width\": 160", "\"width\": 0", "0 x 120"),
        ("\"width\": 160", "\"width\": 99999999", "99999999"),
        (
            "\"width\": 160,\n  \"height\": 120",
            "\"width\": 16384, \"height\": 16384",
            "16384 x 16384",
        ),
        ("\"width\": 160", "\"width\": -160", "line"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": 0.0", "units_per_metre"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": -5.0", "units_per_metre"),
        ("\"baseline_m\": 0.075", "\"baseline_m\": -1.0", "baseline_m"),
        (
            "\"baseline_m\": 0.075",
            "\"baseline_m\": 0.075, \"intrinsics_uncertainty\": {\"fx\": 0}",
            "intrinsics_uncertainty.fx = 0 must",
        ),
        (
            "\"baseline_m\": 0.075",
            "\"baseline_m\": 0.075, \"intrinsics_uncertainty\": {\"cy\": 400}",
            "intrinsics_uncertainty.cy = 400 must",
        ),
        (
            "\"units_per_metre\": 5000.0",
            "\"units_per_metre\": 5000.0, \"raw_disparity\": {\"offset\": 3.0, \"slope\": -0.003}",
            "contradict",
        ),
    ] {
        let bench = Bench::good();
        bench.edit("recording.json", |t| t.replace(from, to));
        bench.calibrate().fails(&["recording.json", says]);
    }
}

#[test]
fn a_camera_that_cannot_be_meant() {
    for (from, to) in [
        ("\"fx\": 145.0", "\"fx\": 1e-300"),
        ("\"fx\": 145.0", "\"fx\": 1e300"),
        ("\"cx\": 79.5", "\"cx\": 1e300"),
        ("\"cx\": 79.5", "\"cx\": -5000.0"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": 1e-300"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": 1e300"),
    ] {
        let bench = Bench::good();
        bench.edit("recording.json", |t| t.replace(from, to));
        bench.calibrate().fails_or_tells(&[]);
    }
}

#[test]
fn a_lens_that_not_every_pixel_has_a_ray_through() {
    for (lens, shown) in [
        ("[-0.8, 0, 0, 0, 0]", "[-0.8, 0, 0, 0, 0]"),
        ("[0, 0, 0, 0, -9]", "[0, 0, 0, 0, -9]"),
        ("[1e30, -1e30, 1e30, 1e30, 1e30]", "1e30"),
        ("[-1e3, 1e5, 1e2, 1e2, 1e5]", "[-1000, 100000, 100, 100, 100000]"),
    ] {
        let bench = Bench::good();
        bench.edit("recording.json", |t| {
            t.replace("\"cy\": 59.5", &format!("\"cy\": 59.5, \"distortion\": {lens}"))
        });
        bench.calibrate().fails(&["recording.json", "k1, k2, p1, p2, k3", shown]);
    }
    let bench = Bench::good();
    bench.edit("recording.json", |t| {
        t.replace("\"cy\": 59.5", "\"cy\": 59.5, \"distortion\": [-0.05, 0.02, 0, 0, 0]")
    });
    bench.calibrate().tells(&["12 of 12 views"]);
}

/// A key that nobody reads may be a slip; files of a later layout must still open.
#[test]
fn keys_that_nobody_knows_are_told_once_each() {
    let bench = Bench::good();
    bench.edit("recording.json", |t| t.replace("\"cy\": 59.5", "\"cy\": 59.5, \"baseline\": 0.08"));
    for view in 0..3 {
        bench.put(&format!("{view:04}/view.json"), "{\"reference_distance\": 1.0, \"roi\": null}");
    }
    bench
        .put("0003/view.json", "{\"target\": {\"width_m\": 1, \"height_m\": 0.8, \"depth_m\": 0}}");
    let result = bench.calibrate().tells(&[
        "recording.json: unknown key \"baseline\"",
        "view.json and 2 more: unknown key \"reference_distance\"",
        "view.json: unknown key \"target.depth_m\"",
    ]);
    let warnings = result["warnings"].as_array().expect("a list");
    assert_eq!(warnings.iter().filter(|w| w.to_string().contains("unknown key")).count(), 3);
    assert_eq!(used(&result), common::GOOD_VIEWS);
}

#[test]
fn a_reference_distance_that_the_plane_contradicts() {
    let bench = Bench::good();
    let axis: Vec<f64> = bench.calibrate().tells(&[])["views"]
        .as_array()
        .expect("views")
        .iter()
        .map(|v| v["axis_distance_m"].as_f64().expect("a distance"))
        .collect();
    let say = |view: usize, metres: f64| {
        bench.put(
            &format!("{view:04}/view.json"),
            format!("{{\"reference_distance_m\": {metres}}}"),
        );
    };
    say(0, axis[0] + 0.002);
    say(1, axis[1] - 0.002);
    let close = bench.calibrate().tells(&[]);
    assert!(!close["warnings"].to_string().contains("reference"), "{}", close["warnings"]);
    say(1, axis[1] - 0.1);
    let off = bench.calibrate().tells(&[
        "in 1 of 2 views with a reference distance",
        "view 0001",
        "+100.0 mm",
        "5 mm and 1 % of the distance",
    ]);
    let told = off["views"][1]["off_reference_m"].as_f64().expect("a difference");
    assert!((told - 0.1).abs() < 1e-9, "{told}");
    assert!(off["views"][2]["off_reference_m"].is_null());
    let page = fs::read_to_string(bench.out().join("report.html")).expect("text");
    assert!(page.contains("+100.0 (!)") && page.contains("−2.0"), "in the table of views");
}

/// The file was there when the recording was opened; its hash cannot be that of nothing.
#[test]
fn a_description_that_is_gone_when_it_is_hashed() {
    let bench = Bench::good();
    bench.put("0003/view.json", "{}");
    let recording = kinoise::io::open(&bench.recording(), &kinoise::io::Assumed::default());
    let recording = recording.expect("opens");
    let options = kinoise::CalibrateOptions {
        form: Some(kinoise::Form::Khoshelham),
        ..kinoise::CalibrateOptions::default()
    };
    let views = kinoise::measure_recording(&recording, &options.measure, &|_, _| ());
    fs::remove_file(bench.file("0003/view.json")).expect("removed");
    let error =
        kinoise::model_of(&recording, &views.expect("measured"), &options).expect_err("gone");
    assert!(error.to_string().contains("0003/view.json"), "{error}");
}

#[test]
fn sizes_that_contradict_the_images() {
    let bench = Bench::good();
    bench.edit("recording.json", |t| t.replace("\"width\": 160", "\"width\": 640"));
    bench.calibrate().fails(&["0000.png", "160 x 120", "640 x 120", "correct width and height"]);
}

#[test]
fn a_model_is_not_a_recording() {
    let bench = Bench::good();
    bench.calibrate().tells(&[]);
    let model = bench.out().join("model.json");
    let out = bench.folder.path().join("second");
    bench.run_to("calibrate", &model, &out, &[]).fails(&["model.json", "folder"]);
    fs::copy(&model, bench.file("recording.json")).expect("copied");
    bench.run_to("calibrate", &bench.recording(), &out, &[]).fails(&[
        "recording.json",
        "kinoise-model/1",
        "recording/1",
    ]);
}

// ---- images --------------------------------------------------------------------------------

/// Every way of spoiling a depth image, and what the message must say.
fn spoiled_images() -> Vec<(Vec<u8>, &'static str)> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("x.png");
    let made = |size: (u32, u32), color, depth, bytes: usize| {
        write_png(&path, size, color, depth, &vec![7; bytes]);
        fs::read(&path).expect("read")
    };
    let whole = fs::read(good().join("0000/depth/0000.png")).expect("read");
    let pixels = 160 * 120;
    vec![
        (made((160, 120), ColorType::Grayscale, BitDepth::Eight, pixels), "8 bit Grayscale"),
        (made((160, 120), ColorType::Rgb, BitDepth::Eight, 3 * pixels), "8 bit Rgb"),
        (made((160, 120), ColorType::Rgb, BitDepth::Sixteen, 6 * pixels), "16 bit Rgb"),
        (
            made((160, 120), ColorType::GrayscaleAlpha, BitDepth::Sixteen, 4 * pixels),
            "16 bit GrayscaleAlpha",
        ),
        (made((80, 60), ColorType::Grayscale, BitDepth::Sixteen, pixels / 2), "80 x 60"),
        (whole[..whole.len() / 2].to_vec(), "not a whole PNG"),
        (whole[..20].to_vec(), "not a whole PNG"),
        (Vec::new(), "not a whole PNG"),
        (b"no picture at all".to_vec(), "not a whole PNG"),
        (png_claiming(1 << 20, 1 << 20), "1048576 x 1048576"),
        (png_claiming(0x7fff_ffff, 0x7fff_ffff), "not a whole PNG"),
    ]
}

/// A PNG header with a right checksum over a size that fits no memory.
fn png_claiming(width: u32, height: u32) -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([16, 0, 0, 0, 0]);
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0d".to_vec();
    bytes.extend(&header);
    bytes.extend(crc32(&header).to_be_bytes());
    bytes.extend(b"\0\0\0\x02IDAT\x78\x9c");
    bytes.extend(crc32(b"IDAT\x78\x9c").to_be_bytes());
    bytes
}

/// The checksum of PNG (ISO 3309), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| (c >> 1) ^ (0xedb8_8320 & (c & 1).wrapping_neg()))
    })
}

#[test]
fn one_spoiled_frame_is_told_and_its_view_stays() {
    // Eleven kinds of damage, four views at a time: the list of notes is cut after eight.
    for few in spoiled_images().chunks(4) {
        let bench = Bench::good();
        for (view, (bytes, _)) in few.iter().enumerate() {
            bench.put(&format!("{view:04}/depth/0001.png"), bytes);
        }
        let run = bench.calibrate();
        for (view, (_, says)) in few.iter().enumerate() {
            let told = format!("view {view:04}: frame left out");
            let line = run.stderr.lines().find(|l| l.contains(&told)).expect(&run.stderr);
            assert!(line.contains("0001.png") && line.contains(says), "{says}: {line}");
        }
        assert_eq!(used(&run.tells(&[])), common::GOOD_VIEWS);
    }
}

#[test]
fn a_view_of_spoiled_frames_is_told_and_the_others_stay() {
    let (bytes, says) = spoiled_images().swap_remove(0);
    let bench = Bench::good();
    bench.put("0003/depth/0000.png", &bytes).put("0003/depth/0001.png", &bytes);
    let result = bench.calibrate().tells(&["view 0003 was left out", "0000.png", says]);
    assert_eq!(used(&result), common::GOOD_VIEWS - 1);
    assert_eq!(result["excluded"][0]["view"], "0003");
}

#[test]
fn nothing_but_spoiled_frames() {
    for (bytes, says) in spoiled_images() {
        let bench = Bench::good();
        for view in 0..common::GOOD_VIEWS {
            for frame in 0..2 {
                bench.put(&format!("{view:04}/depth/{frame:04}.png"), &bytes);
            }
        }
        bench.calibrate().fails(&["no view of 12", "view 0000", "0000.png", says]);
    }
}

#[test]
fn a_frame_or_a_view_without_any_depth() {
    let bench = Bench::good();
    let nothing = Frame { width: 160, height: 120, raw: vec![0; 160 * 120] };
    write_depth(&bench.file("0002/depth/0001.png"), &nothing);
    write_depth(&bench.file("0005/depth/0000.png"), &nothing);
    write_depth(&bench.file("0005/depth/0001.png"), &nothing);
    let result = bench.calibrate().tells(&[
        "view 0002: frame left out",
        "no pixel carries a depth",
        "view 0005 was left out",
    ]);
    assert_eq!(used(&result), common::GOOD_VIEWS - 1);
}

#[test]
fn a_view_without_a_plane() {
    let bench = Bench::good();
    // Words from a multiplicative generator: depths of 0.4 to 4 m without any order.
    let mut state = 1u32;
    let mut noise = || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        2000 + (state >> 16) as u16 % 18_000
    };
    let words = (0..160 * 120).map(|_| noise()).collect();
    let random = Frame { width: 160, height: 120, raw: words };
    let sphere = Frame { width: 160, height: 120, raw: sphere() };
    for (view, frame) in [("0004", &random), ("0007", &sphere)] {
        for name in ["0000", "0001"] {
            write_depth(&bench.file(&format!("{view}/depth/{name}.png")), frame);
        }
    }
    let result =
        bench.calibrate().tells(&["view 0004 was left out", "view 0007 was left out", "view.json"]);
    assert_eq!(used(&result), common::GOOD_VIEWS - 2);
    // Saying where the target is does not make it one.
    bench.put("0004/view.json", "{\"roi\": [40, 30, 120, 90]}");
    bench.calibrate().tells(&["view 0004 was left out", "view 0007 was left out"]);
}

/// A ball of 0.3 m radius whose middle is 1.2 m away.
fn sphere() -> Vec<u16> {
    let (distance, radius) = (1.2f64, 0.3);
    (0..160 * 120)
        .map(|i| {
            let (x, y) = (((i % 160) as f64 - 79.5) / 145.0, ((i / 160) as f64 - 59.5) / 145.0);
            let a = 1.0 + x * x + y * y;
            let root = distance * distance - a * (distance * distance - radius * radius);
            if root > 0.0 { (5000.0 * (distance - root.sqrt()) / a) as u16 } else { 0 }
        })
        .collect()
}

// ---- depth.txt -----------------------------------------------------------------------------

#[test]
fn a_list_that_names_a_missing_file() {
    let bench = Bench::good();
    fs::remove_file(bench.file("0006/depth/0000.png")).expect("removed");
    let result = bench.calibrate().tells(&["view 0006", "depth.txt line 2", "0000.png", "missing"]);
    assert_eq!(used(&result), common::GOOD_VIEWS);
    fs::remove_file(bench.file("0006/depth/0001.png")).expect("removed");
    bench.calibrate().tells(&["view 0006 was left out", "0006/depth.txt"]);
}

#[test]
fn lines_that_are_no_frames() {
    let bench = Bench::good();
    let mut spoilt: Vec<String> = Vec::new();
    for line in ["no-time depth/0001.png", "NAN depth/0001.png", "INF depth/0001.png", "3.5"] {
        let view = spoilt.len();
        bench.edit(&format!("{view:04}/depth.txt"), |t| format!("{t}{line}\n"));
        spoilt.push(format!("{view:04}/depth.txt, line 4: \"{line}\""));
    }
    let needles: Vec<&str> = spoilt.iter().map(String::as_str).collect();
    let result = bench.calibrate().tells(&needles);
    assert_eq!(used(&result), common::GOOD_VIEWS - needles.len());
}

#[test]
fn a_list_that_is_empty_or_binary() {
    let bench = Bench::good();
    bench.put("0001/depth.txt", "# nothing\n").put("0002/depth.txt", [0xff, 0x00, 0xfe]);
    let result = bench.calibrate().tells(&["view 0001 was left out", "view 0002 was left out"]);
    assert_eq!(used(&result), common::GOOD_VIEWS - 2);
}

#[test]
fn a_folder_with_a_view_file_and_no_list() {
    let bench = Bench::good();
    bench.put("notes/view.json", "{}");
    bench.calibrate().tells(&["view notes was left out", "depth.txt"]);
}

#[test]
fn frames_out_of_order_are_sorted() {
    let bench = Bench::good();
    let told = |run: Run, says: &str| assert_eq!(used(&run.tells(&["view 0006", says])), 12);
    bench.edit("0006/depth.txt", |t| {
        let mut lines: Vec<&str> = t.lines().collect();
        lines.reverse();
        lines.join("\n\n").replace(' ', "\t") + "\n"
    });
    told(bench.calibrate(), "out of order");
    let files = |bench: &Bench| {
        ["model.json", "measurements.csv"].map(|n| fs::read(bench.out().join(n)).expect("read"))
    };
    let sorted = Bench::good();
    sorted.calibrate().tells(&[]);
    assert_eq!(files(&bench)[1], files(&sorted)[1], "order in the list changes no number");
}

#[test]
fn a_timestamp_given_twice() {
    let bench = Bench::good();
    bench.edit("0006/depth.txt", |t| format!("{t}{}\n", t.lines().last().expect("a line")));
    bench.calibrate().tells(&["view 0006", "twice"]);
    let bench = Bench::good();
    bench.put("0006/depth.txt", "1.0 depth/0000.png\n1.0 depth/0001.png\n");
    bench.calibrate().tells(&["view 0006", "depth.txt", "same timestamp"]);
}

// ---- view.json -----------------------------------------------------------------------------

#[test]
fn a_broken_view_file_costs_its_view_alone() {
    let broken = [
        ("{\n\"roi\": [1, 2\n", "line"),
        ("{\"roi\": [1, 2, 3]}", "line 1"),
        ("{\"polygon\": [[10, 10], [20, 20]]}", "three corners"),
        ("{\"polygon\": []}", "three corners"),
        ("{\"roi\": [50, 50, 50, 60]}", "empty"),
        ("{\"roi\": [60, 50, 40, 60]}", "empty"),
        ("{\"roi\": [60, 50, 80, 70], \"polygon\": [[1, 1], [9, 1], [9, 9]]}", "both"),
        ("{\"reference_distance_m\": -1}", "reference_distance_m"),
        ("{\"reference_distance_m\": 1e999}", "line 1"),
        ("{\"reference_uncertainty_m\": 0.001}", "without reference_distance_m"),
        (
            "{\"reference_distance_m\": 2, \"reference_uncertainty_m\": 0}",
            "reference_uncertainty_m = 0 must",
        ),
        (
            "{\"reference_distance_m\": 2, \"reference_uncertainty_m\": 3}",
            "reference_uncertainty_m = 3 must be above 0 and below reference_distance_m = 2; is it in millimetres?",
        ),
        ("{\"reference_distance_m\": 2, \"reference_uncertainty_m\": \"1\"}", "line 1"),
        (
            "{\"target\": {\"width_m\": 1, \"height_m\": 0.5, \"flatness_m\": 0.2}}",
            "target.flatness_m = 0.2 must be above 0 and at most a tenth",
        ),
        ("{\"target\": {\"width_m\": 1, \"height_m\": -0.5}}", "height_m = -0.5"),
    ];
    for few in broken.chunks(3) {
        let bench = Bench::good();
        for (view, (text, _)) in few.iter().enumerate() {
            bench.put(&format!("{view:04}/view.json"), text);
        }
        let run = bench.calibrate();
        for (view, (_, says)) in few.iter().enumerate() {
            let told = format!("view {view:04} was left out");
            let line = run.stderr.lines().find(|l| l.contains(&told)).expect(&run.stderr);
            assert!(line.contains("view.json") && line.contains(says), "{says}: {line}");
        }
        assert_eq!(used(&run.tells(&[])), common::GOOD_VIEWS - few.len());
    }
}

#[test]
fn a_region_that_holds_nothing() {
    let bench = Bench::good();
    let empty = [
        ("{\"polygon\": [[900, 900], [990, 900], [990, 990]]}", "outside the image"),
        ("{\"polygon\": [[50, 50], [50, 50], [50, 50]]}", "region"),
        ("{\"roi\": [0, 0, 3, 3]}", "region"),
        ("{\"roi\": [-1e9, -1e9, -1e8, -1e8]}", "outside the image"),
    ];
    for (view, (text, _)) in empty.iter().enumerate() {
        bench.put(&format!("{view:04}/view.json"), text);
    }
    let result = bench.calibrate().tells(&[]);
    assert_eq!(used(&result), common::GOOD_VIEWS - empty.len());
    for (excluded, (_, says)) in result["excluded"].as_array().expect("a list").iter().zip(empty) {
        assert!(excluded["reason"].as_str().expect("words").contains(says), "{excluded}");
    }
    let bench = Bench::good();
    bench
        .put("0008/view.json", "{\"polygon\": [[1e308, -1e308], [-1e308, 1e308], [1e308, 1e308]]}");
    bench.calibrate().tells(&[]);
}

/// A broken view among many oddities must not be the one that is cut off the list.
#[test]
fn a_view_left_out_is_told_before_smaller_oddities() {
    let bench = Bench::good();
    for view in 0..11 {
        bench.put(&format!("{view:04}/depth/0001.png"), b"spoiled");
    }
    bench.put("0011/view.json", "{");
    bench.calibrate().tells(&["view 0011 was left out"]);
}

// ---- too few, too alike ---------------------------------------------------------------------

#[test]
fn too_few_or_too_uniform_views() {
    Bench::of(&[1.5], &[0.0]).calibrate().fails(&["measurements.csv", "too few"]);
    Bench::of(&[1.0, 2.0], &[0.0]).calibrate().fails(&["measurements.csv"]);
    Bench::of(&[2.0], &[0.0, 20.0, 40.0, 50.0, 60.0]).calibrate().fails_or_tells(&["note: "]);
    Bench::of(&[1.0, 1.5, 2.0, 3.0], &[0.0]).calibrate().tells(&["tilt"]);
    Bench::of(&[2.0], &[0.0, 0.5, 1.0, 1.5, 2.0])
        .calibrate()
        .fails(&["1 different distance", "other distances"]);
}

/// When no model can be made, the reasons why views fell out are what the user needs.
#[test]
fn exclusions_are_told_when_the_fit_fails_too() {
    let bench = Bench::of(&[1.0, 1.5, 2.0, 2.5], &[0.0]);
    let nothing = Frame { width: 160, height: 120, raw: vec![0; 160 * 120] };
    for view in 0..3 {
        for frame in 0..2 {
            write_depth(&bench.file(&format!("{view:04}/depth/{frame:04}.png")), &nothing);
        }
    }
    let run = bench.calibrate();
    run.fails(&["too few"]);
    assert!(run.stderr.contains("view 0001 was left out"), "{}", run.stderr);
}

// ---- tables ---------------------------------------------------------------------------------

const GOOD_TABLE: &str = "z_m,theta_rad,sigma_m\n1,0,0.0019\n1.5,0,0.0035\n2,0,0.006\n3,0,0.014\n";

#[test]
fn a_good_table() {
    Bench::empty().fit(GOOD_TABLE).tells(&["note: "]);
}

#[test]
fn tables_with_a_bad_cell() {
    for (row, says) in [
        ("1e300,0,0.01", "z_m = 1e300"),
        ("1500,0,0.01", "z_m = 1500 is farther than any"),
        ("-1e300,0,0.003", "z_m = -1e300 must be positive"),
        ("2,0,1e300", "sigma_m = 1e300 is no depth noise"),
        ("nan,0,0.01", "z_m"),
        ("inf,0,0.01", "z_m"),
        ("-2,0,0.01", "z_m"),
        ("0,0,0.01", "z_m"),
        ("2,45,0.01", "degrees"),
        ("2,-0.1,0.01", "theta_rad"),
        ("2,0,-0.01", "sigma_m"),
        ("2,0,0", "sigma_m"),
        ("2,0,NaN", "sigma_m"),
        ("2,0,", "sigma_m"),
        ("2,0,six", "sigma_m"),
        ("2,0", "2 cells, the header has 3"),
        ("2;0;0.01", "line 6"),
    ] {
        let run = Bench::empty().fit(&format!("{GOOD_TABLE}{row}\n"));
        run.fails(&["table.csv", "line 6", says]);
    }
}

#[test]
fn tables_that_are_no_tables() {
    for (table, says) in [
        ("", "z_m"),
        ("1,0,0.0019\n1.5,0,0.0035\n", "z_m"),
        ("z_m,sigma_m\n1,0.002\n", "theta_rad"),
        ("z,theta,sigma\n1,0,0.002\n", "z_m"),
        ("z_m,theta_rad,sigma_m\n", "too few"),
        ("z_m,theta_rad,sigma_m,n\n1,0,0.002,5\n1,0,0.002,\n", "missing in others"),
        ("z_m,theta_rad,sigma_m\n1,0,0.0019\n2,0,0.006\n", "too few"),
        ("z_m,theta_rad,sigma_m\n2,0,0.006\n2,0,0.006\n2,0,0.006\n2,0.5,0.006\n", "distance"),
        ("{\"format\": \"kinoise-model/1\"}", "z_m"),
    ] {
        Bench::empty().fit(table).fails(&["table.csv", says]);
    }
    let bench = Bench::empty();
    let gone = bench.folder.path().join("gone.csv");
    bench.run("fit", &gone, &[]).fails(&["gone.csv"]);
    let binary = bench.folder.path().join("binary.csv");
    fs::write(&binary, [0xff, 0xfe, 0x00, 0x80, b'\n', 0xff]).expect("written");
    bench.run("fit", &binary, &[]).fails(&["binary.csv"]);
    bench.run("fit", bench.folder.path(), &[]).fails(&[]);
}

/// Extreme but legal numbers: a model or a refusal, never a number that is none.
#[test]
fn tables_of_extreme_numbers() {
    for table in [
        "z_m,theta_rad,sigma_m\n1e-300,0,1e-300\n1e-200,0,1e-200\n1,0,1\n2,0.3,1\n3,0.4,2\n",
        "z_m,theta_rad,sigma_m\n1,0,1e300\n2,0,1e300\n3,0,1e300\n4,0.3,1e300\n5,0.3,1e300\n",
        "z_m,theta_rad,sigma_m\n1e300,0,1\n2e300,0,1\n3e300,0,1\n4e300,0.3,2\n5e300,0.5,3\n",
        "z_m,theta_rad,sigma_m\n1,1.5707,1\n2,1.5707,1\n3,1.57,1\n4,1.57,2\n5,1.5,3\n",
        "z_m,theta_rad,sigma_m\n1,0,0.002\n1.5,0,0.002\n2,0,0.002\n3,0,0.002\n4,0,0.002\n",
        "z_m,theta_rad,sigma_m\n1,0,0.02\n1.5,0,0.01\n2,0,0.005\n3,0,0.002\n4,0,0.001\n",
        "z_m,theta_rad,sigma_m,n\n1,0,0.002,1\n1.5,0,0.003,1e300\n2,0,0.006,1\n3,0.5,0.02,1\n4,0.5,0.03,2\n",
    ] {
        Bench::empty().fit(table).fails_or_tells(&[]);
    }
}

// ---- options --------------------------------------------------------------------------------

/// The good recording's images without their description.
fn plain_folder() -> Bench {
    let bench = Bench::empty();
    for view in 0..common::GOOD_VIEWS {
        let from = good().join(format!("{view:04}/depth/0000.png"));
        bench.put(&format!("{view:04}.png"), fs::read(from).expect("read"));
    }
    bench
}

#[test]
fn a_plain_folder_needs_its_intrinsics() {
    plain_folder().calibrate().fails(&["recording", "--intrinsics fx,fy,cx,cy"]);
    plain_folder()
        .calibrate_with(&["--intrinsics", "145,145,79.5,59.5", "--units-per-metre", "5000"])
        .tells(&["12 of 12 views", "single frame"]);
}

#[test]
fn options_that_mean_nothing() {
    for (options, says) in [
        (["--intrinsics", "0,0,0,0"], "--intrinsics"),
        (["--intrinsics", "NaN,145,79.5,59.5"], "--intrinsics"),
        (["--intrinsics", "145,145,inf,59.5"], "--intrinsics"),
        (["--intrinsics", "-145,145,79.5,59.5"], "--intrinsics"),
        (["--intrinsics", "a,b,c,d"], "--intrinsics"),
        (["--intrinsics", "145,145"], "--intrinsics"),
        (["--raw-disparity", "0,0"], "raw_disparity"),
        (["--raw-disparity", "x,y"], "--raw-disparity"),
        (["--units-per-metre", "0"], "--units-per-metre"),
        (["--units-per-metre", "NaN"], "--units-per-metre"),
        (["--baseline", "0"], "baseline"),
        (["--form", "cubic"], "cubic"),
        (["--sigma", "loud"], "--sigma"),
        (["--ransac-threshold", "0"], "--ransac-threshold"),
        (["--ransac-threshold", "NaN"], "--ransac-threshold"),
        (["--threads", "0"], "--threads"),
        (["--threads", "many"], "--threads"),
        (["--seed", "x"], "--seed"),
        (["--colour", "red"], "--colour"),
    ] {
        let mut all = options.to_vec();
        if options[0] != "--intrinsics" {
            all.extend(["--intrinsics", "145,145,79.5,59.5"]);
        }
        plain_folder().calibrate_with(&all).fails(&[says]);
    }
}

#[test]
fn options_that_would_have_no_effect() {
    for (option, value) in [
        ("--intrinsics", "145,145,79.5,59.5"),
        ("--units-per-metre", "1000"),
        ("--raw-disparity", "3.33,-0.003"),
        ("--baseline", "0.08"),
    ] {
        Bench::good().calibrate_with(&[option, value]).fails(&[
            option,
            "recording.json",
            "leave the option out",
        ]);
    }
}

#[test]
fn an_image_size_for_a_model_that_has_its_own() {
    let bench = Bench::good();
    bench.calibrate().tells(&[]);
    let model = bench.out().join("model.json");
    let simulate = |options: &[&str]| {
        let out = bench.folder.path().join("simulated");
        kinoise().arg("simulate").arg(out).args(options).output().expect("the program runs")
    };
    let path = model.to_str().expect("a plain path");
    for (options, says) in [
        (&["--model", path, "--shrink", "2"][..], "--shrink: "),
        (&["--shrink", "9"], "1 to 8"),
        (&["--shrink", "0"], "1 to 8"),
    ] {
        let output = simulate(options);
        let stderr = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains(says) && stderr.lines().count() == 1, "{stderr}");
    }
    let help = String::from_utf8(simulate(&["-h"]).stdout).expect("text");
    assert!(help.contains("--shrink") && help.contains("to 8"), "{help}");
}

#[test]
fn no_command_and_a_wrong_one() {
    for arguments in [&[][..], &["calibrat"], &["calibrate"], &["fit", "x.csv"]] {
        let output = kinoise().args(arguments).output().expect("the program runs");
        let stderr = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(output.stdout.is_empty());
        if !arguments.is_empty() {
            assert_eq!(stderr.matches("kinoise: ").count(), 1, "{stderr}");
            assert_eq!(stderr.lines().count(), 1, "{stderr}");
        }
    }
}

/// Permission bits do not stop root; a path below a regular file stops everyone.
#[test]
fn a_folder_that_cannot_be_written() {
    let bench = Bench::good();
    let file = bench.folder.path().join("file");
    fs::write(&file, b"in the way").expect("written");
    for out in [file.join("below"), file.clone()] {
        bench.run_to("calibrate", &bench.recording(), &out, &[]).fails(&["file", "-o"]);
        let table = bench.folder.path().join("table.csv");
        fs::write(&table, GOOD_TABLE).expect("written");
        bench.run_to("fit", &table, &out, &[]).fails(&["file", "-o"]);
    }
    assert_eq!(fs::read(&file).expect("read"), b"in the way");
}

#[test]
fn a_model_to_simulate_with_that_is_none() {
    let bench = Bench::empty();
    let model = bench.folder.path().join("model.json");
    for text in ["", "{}", "{\"format\": \"kinoise-model/9\"}", "{\"format\": \"kinoise-model/1\"}"]
    {
        fs::write(&model, text).expect("written");
        let output = kinoise()
            .arg("simulate")
            .arg(bench.recording())
            .arg("--model")
            .arg(&model)
            .output()
            .expect("the program runs");
        let stderr = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.starts_with("kinoise: ") && stderr.contains("model.json"), "{stderr}");
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
        assert!(!bench.recording().exists(), "nothing is written before the model is read");
    }
}

// ---- damage of any kind, through the library --------------------------------------------------

/// Where to damage a file, as a share of its length, and with what.
#[derive(Debug, Clone)]
enum Damage {
    Cut(f64),
    Put(Vec<(f64, u8)>),
}

fn damage() -> impl Strategy<Value = Damage> {
    // Digits, signs and brackets damage text more subtly than random bytes do.
    let byte =
        prop_oneof![any::<u8>(), proptest::sample::select(b"0129.-+eE,:[]{}\" \nN".to_vec())];
    prop_oneof![
        1 => (0.0..1.0f64).prop_map(Damage::Cut),
        4 => proptest::collection::vec((0.0..1.0f64, byte), 1..4).prop_map(Damage::Put),
    ]
}

impl Damage {
    fn done_to(&self, bytes: &mut Vec<u8>) {
        let at = |share: f64, length: usize| (share * length as f64) as usize;
        match self {
            Damage::Cut(share) => bytes.truncate(at(*share, bytes.len())),
            Damage::Put(changes) => {
                let length = bytes.len();
                changes.iter().for_each(|(share, byte)| bytes[at(*share, length)] = *byte);
            }
        }
    }
}

/// Four frontal views, so that a fit takes no time; spoiled and mended again by every case.
fn small() -> &'static Bench {
    static SMALL: std::sync::OnceLock<Bench> = std::sync::OnceLock::new();
    SMALL.get_or_init(|| {
        let bench = Bench::of(&[1.0, 1.5, 2.0, 3.0], &[0.0]);
        bench.put(
            "0001/view.json",
            "{\"polygon\": [[60.0, 40.0], [99.5, 40.0], [99.5, 80.0], [60.0, 80.0]],\n \"reference_distance_m\": 1.0}\n",
        );
        bench
    })
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 256,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(7),
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_damage_makes_it_panic(
        file in proptest::sample::select(vec![
            "recording.json", "recording.json", "0000/depth.txt", "0001/view.json", "0000/depth/0000.png",
        ]),
        damage in damage(),
    ) {
        let bench = small();
        let whole = fs::read(bench.file(file)).expect("read");
        let mut bytes = whole.clone();
        damage.done_to(&mut bytes);
        bench.put(file, &bytes);
        let options = kinoise::CalibrateOptions {
            form: Some(kinoise::Form::Khoshelham),
            ..kinoise::CalibrateOptions::default()
        };
        let result = kinoise::io::open(&bench.recording(), &kinoise::io::Assumed::default())
            .and_then(|recording| {
                let views = kinoise::measure_recording(&recording, &options.measure, &|_, _| ())?;
                has_only_numbers("measurements", &kinoise::measure::write_measurements(&views.views));
                kinoise::model_of(&recording, &views, &options)?.model.to_json()
            });
        bench.put(file, whole);
        match result {
            Ok(model) => has_only_numbers("model", &model),
            Err(e) => prop_assert!(!e.to_string().contains('\n'), "{e}"),
        }
    }
}
