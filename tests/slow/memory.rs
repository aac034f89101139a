//! Memory does not grow with the number of frames.

use std::fmt::Write as _;
use std::fs;
use std::process::Stdio;
use std::time::{Duration, Instant};

use kinoise::Seed;
use kinoise::io::write_recording_file;
use kinoise::plane::Plane;
use kinoise::scene::Bench;
use kinoise::simulate::{kinect_v1, shoot};

use crate::common::{BOARD, truth, write_depth};

const VIEWS: usize = 4;
const FRAMES: usize = 500;
/// Images a view; its list names them over and over, so that the disk stays small.
const IMAGES: usize = 8;
/// All 2,000 frames as words would be 1.2 GB; the accumulators of a view are 20 MB a thread.
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
    let start = Instant::now();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_kinoise"))
        .arg("calibrate")
        .arg(&root)
        .arg("-o")
        .arg(folder.path().join("out"))
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
    assert!(status.success());
    let table = fs::read_to_string(folder.path().join("out/measurements.csv")).expect("measured");
    assert!(table.lines().count() > VIEWS);
    assert!(peak_mb > 5.0, "the peak was not seen: {peak_mb} MB");
    assert!(peak_mb < MAX_MB, "{peak_mb} MB");
}

/// High-water mark of the process's resident memory, MB.
fn peak_of(process: u32) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0 / 1e6)
}
