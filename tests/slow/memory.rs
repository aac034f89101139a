//! Memory does not grow with the number of frames, nor that of a diagnosis with large images.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::process::{ExitStatus, Stdio};
use std::time::{Duration, Instant};

use kinoise::io::write_recording_file;
use kinoise::plane::Plane;
use kinoise::scene::Bench;
use kinoise::simulate::{kinect_v1, shoot};
use kinoise::view::RecordingFile;
use kinoise::{Camera, NoiseModel, Seed, Sensor};

use crate::common::{BOARD, truth, write_depth};

const VIEWS: usize = 4;
const FRAMES: usize = 500;
/// Images per view; the list repeats them, so that little disk space is needed.
const IMAGES: usize = 8;
/// All 2,000 frames as words would be 1.2 GB; the accumulators of a view are 20 MB per thread.
const MAX_MB: f64 = 300.0;

#[test]
fn two_thousand_frames_fit_into_300_megabytes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let root = folder.path().join("recording");
    fs::create_dir(&root).expect("made");
    let sensor = kinect_v1(1);
    let rays = sensor.camera.rays();
    write_recording_file(&root, &sensor).expect("written");
    for view in 0..VIEWS {
        let plane = Plane::tilted(0.9 + 0.5 * view as f64, 0.3, view as f64);
        let mut list = String::new();
        for k in 0..IMAGES {
            let seed = Seed((view * IMAGES + k) as u64);
            let frame = shoot(&sensor, &rays, &Bench::bare(plane, BOARD), &truth(), seed);
            write_depth(&root.join(format!("{view}/depth/{k}.png")), &frame);
        }
        for k in 0..FRAMES {
            let _ = writeln!(list, "{:.6} depth/{}.png", k as f64 / 30.0, k % IMAGES);
        }
        fs::write(root.join(format!("{view}/depth.txt")), list).expect("written");
    }
    let out = folder.path().join("out");
    let (status, peak_mb) =
        run(&["calibrate".as_ref(), root.as_ref(), "-o".as_ref(), out.as_ref()]);
    assert!(status.success());
    let table = fs::read_to_string(folder.path().join("out/measurements.csv")).expect("measured");
    assert!(table.lines().count() > VIEWS);
    assert!(peak_mb > 5.0, "the peak was not seen: {peak_mb} MB");
    assert!(peak_mb < MAX_MB, "{peak_mb} MB");
}

/// Limit for the peak of a diagnosis of eight views of 3 megapixels, MB. Kept whole they take 71 bytes per
/// pixel, 1.8 GB; only a quarter is kept, beside what two threads need to read a view.
const MAX_LARGE_MB: f64 = 1300.0;

/// Memory depends on the examined pixels only, and these suffice.
#[test]
fn a_diagnosis_of_large_images_keeps_a_part_of_them_and_finds_the_cause() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    let mut model = NoiseModel::paper();
    let sensor = Sensor { camera: Camera::centred(2048, 1536, 1856.0), ..kinect_v1(1) };
    model.sensor = Some(RecordingFile::of(&sensor));
    model.write(&at("model.json")).expect("written");
    let [rec, file, out] = ["rec", "model.json", "out"].map(at);
    let simulate = ["--distances", "1,1.5,2,3", "--tilts", "0,30", "--frames", "2", "--effect"];
    let bowl = ["radial-disparity-bias:k_px=1"];
    let words = simulate.iter().chain(&bowl).map(AsRef::<OsStr>::as_ref);
    let first: [&OsStr; 4] = ["simulate".as_ref(), rec.as_ref(), "-m".as_ref(), file.as_ref()];
    assert!(run(&first.into_iter().chain(words).collect::<Vec<_>>()).0.success());
    let words: [&OsStr; 6] = [
        "diagnose".as_ref(),
        rec.as_ref(),
        "-m".as_ref(),
        file.as_ref(),
        "-o".as_ref(),
        out.as_ref(),
    ];
    let (status, peak_mb) = run(&words);
    assert_eq!(status.code(), Some(1), "a mismatch");
    assert!((5.0..MAX_LARGE_MB).contains(&peak_mb), "{peak_mb} MB");
    let text = fs::read_to_string(out.join("diagnosis.json")).expect("text");
    let diagnosis: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let first = &diagnosis["findings"][0];
    assert_eq!(first["effect"], "radial-disparity-bias");
    let k_px = first["parameters"]["k_px"]["value"].as_f64().expect("a number");
    assert!((k_px - 1.0).abs() < 0.2, "{k_px} px");
    assert!(text.contains("one block of 64 x 64 px in 4 is looked at"));
}

/// Runs the program with these arguments; returns its exit status and peak memory, MB.
fn run(words: &[&OsStr]) -> (ExitStatus, f64) {
    let start = Instant::now();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_kinoise"))
        .args(words)
        .stderr(Stdio::null())
        .spawn()
        .expect("the program runs");
    let mut peak_mb = 0.0f64;
    let status = loop {
        peak_mb = peak_mb.max(peak_of(child.id()).unwrap_or(0.0));
        if let Some(status) = child.try_wait().expect("a child") {
            break status;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    println!("peak {peak_mb:.0} MB, {:.1} s", start.elapsed().as_secs_f64());
    (status, peak_mb)
}

/// High-water mark of the process's resident memory, MB.
fn peak_of(process: u32) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0 / 1e6)
}
