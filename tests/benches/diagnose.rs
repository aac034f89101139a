//! Times a whole diagnosis, and the decoding of its images on one thread: their ratio holds on faster and
//! slower machines.
//!
//! `cargo bench --bench diagnose`: 24 views of 8 frames of 640 x 480 px, and the real Kinect's 39 views
//! where KINOISE_DATA (../shared/data) has them. One run takes seconds, so it is timed whole.
//! KINOISE_BENCH_RUNS is the number of runs (3); the fastest counts, since on a loaded machine the others
//! measure the load.

#[allow(dead_code, unused_imports)]
#[path = "../common/raytraced/mod.rs"]
mod raytraced;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use kinoise::io::{Assumed, FrameSource, open};
use raytraced::{Cell, Order, Set, write};

/// Limits of one recording on two threads.
struct Mark {
    seconds: f64,
    megabytes: f64,
}

const SIMULATED: Mark = Mark { seconds: 10.0, megabytes: 500.0 };
const REAL: Mark = Mark { seconds: 20.0, megabytes: 500.0 };
/// A bias, a variance and correlated noise: every layer has work.
const EFFECTS: [&str; 3] = ["radial-disparity-bias", "vignetting", "spatial-correlation"];

fn main() -> ExitCode {
    // `cargo test --benches` does not pass --bench, and must not take a minute.
    if !std::env::args().any(|a| a == "--bench") {
        return ExitCode::SUCCESS;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let effects = EFFECTS.map(String::from).to_vec();
    let (views, frames) = (Some(24), Some(8));
    let cell = Cell::Single;
    let set =
        Set::draw(Order { cell, effects, strength: 1.0, seed: 3, views, frames, small: false })
            .expect("effects that exist");
    write(&set, folder.path()).expect("written");
    let model = folder.path().join("model").join(format!("{}.json", set.name));
    let recording = folder.path().join(&set.name);
    let mut met = holds("24 views x 8 frames", &recording, Some(&model), &SIMULATED);
    let real = std::env::var_os("KINOISE_DATA")
        .map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from)
        .join("herrera-kinect-v1/recording");
    if real.is_dir() {
        met &= holds("a real Kinect's 39 views", &real, None, &REAL);
    } else {
        println!("{} is not here: the real views are not measured", real.display());
    }
    if met { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Diagnoses the recording a few times and reports the best run.
fn holds(what: &str, recording: &Path, model: Option<&Path>, mark: &Mark) -> bool {
    let runs: usize =
        std::env::var("KINOISE_BENCH_RUNS").ok().and_then(|n| n.parse().ok()).unwrap_or(3);
    let (mut seconds, mut megabytes) = (f64::INFINITY, 0.0f64);
    let mut decoding = f64::INFINITY;
    for _ in 0..runs.max(1) {
        decoding = decoding.min(decode(recording).as_secs_f64());
        let (time, most) = diagnose(recording, model);
        seconds = seconds.min(time.as_secs_f64());
        megabytes = megabytes.max(most);
    }
    println!(
        "{what} of 640 x 480 px on two threads: {seconds:.1} s (mark {}), {megabytes:.0} MB (mark {}), {:.1} times the {decoding:.2} s that decoding them takes",
        mark.seconds,
        mark.megabytes,
        seconds / decoding
    );
    seconds <= mark.seconds && megabytes <= mark.megabytes
}

/// Decodes every depth image once.
fn decode(root: &Path) -> Duration {
    let recording = open(root, &Assumed::default()).expect("a recording");
    let camera = &recording.sensor.camera;
    let start = Instant::now();
    for frame in recording.views.iter().flat_map(|v| &v.depth) {
        let mut source = FrameSource::new(camera.width, camera.height);
        std::hint::black_box(source.read(&frame.path).expect("a depth image"));
    }
    start.elapsed()
}

/// Time and peak memory, MB.
fn diagnose(recording: &Path, model: Option<&Path>) -> (Duration, f64) {
    let output = tempfile::tempdir().expect("a temporary folder");
    let start = Instant::now();
    let mut command = Command::new(env!("CARGO_BIN_EXE_kinoise"));
    command.arg("diagnose").arg(recording).arg("-o").arg(output.path());
    if let Some(model) = model {
        command.arg("--model").arg(model);
    }
    let mut child =
        command.args(["--threads", "2"]).stderr(Stdio::null()).spawn().expect("the program runs");
    let mut megabytes = 0.0f64;
    let status = loop {
        megabytes = megabytes.max(peak_of(child.id()).unwrap_or(0.0));
        if let Some(status) = child.try_wait().expect("a child") {
            break status;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    assert_eq!(status.code(), Some(1), "a mismatch is to be found");
    (start.elapsed(), megabytes)
}

/// High-water mark of the process's resident memory, MB; `None` where there is no /proc.
fn peak_of(process: u32) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0 / 1e6)
}
