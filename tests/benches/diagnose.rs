//! A diagnosis of 24 views of 8 frames of 640 x 480 px: the marks are 20 s on two cores and 1 GB.
//!
//! One run takes seconds, so it is timed whole: `cargo bench --bench diagnose`. KINOISE_BENCH_RUNS
//! is how often (3); the fastest counts, as on a loaded machine the others measure the load.

#[allow(dead_code, unused_imports)]
#[path = "../common/raytraced/mod.rs"]
mod raytraced;

use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use raytraced::{Cell, Order, Set, write};

const SECONDS: f64 = 20.0;
const MEGABYTES: f64 = 1000.0;
/// A bias, a variance and correlated noise: every layer has work.
const EFFECTS: [&str; 3] = ["radial-disparity-bias", "vignetting", "spatial-correlation"];

struct Spent {
    seconds: f64,
    megabytes: f64,
}

fn main() -> ExitCode {
    // `cargo test --benches` gives none of this; it is not to take a minute there.
    if !std::env::args().any(|a| a == "--bench") {
        return ExitCode::SUCCESS;
    }
    let runs: usize =
        std::env::var("KINOISE_BENCH_RUNS").ok().and_then(|n| n.parse().ok()).unwrap_or(3);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let effects = EFFECTS.map(String::from).to_vec();
    let (views, frames) = (Some(24), Some(8));
    let cell = Cell::Single;
    let set =
        Set::draw(Order { cell, effects, strength: 1.0, seed: 3, views, frames, small: false })
            .expect("effects that exist");
    write(&set, folder.path()).expect("written");
    let mut fastest = f64::INFINITY;
    let mut most = 0.0f64;
    for run in 0..runs.max(1) {
        let spent = diagnose(folder.path(), &set.name, run);
        println!("run {run}: {:.1} s, {:.0} MB at most", spent.seconds, spent.megabytes);
        fastest = fastest.min(spent.seconds);
        most = most.max(spent.megabytes);
    }
    println!(
        "24 views x 8 frames of 640 x 480 px on two threads: {fastest:.1} s (mark {SECONDS}), {most:.0} MB (mark {MEGABYTES})"
    );
    if fastest <= SECONDS && most <= MEGABYTES { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn diagnose(root: &Path, name: &str, run: usize) -> Spent {
    let start = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_kinoise"))
        .arg("diagnose")
        .arg(root.join(name))
        .arg("--model")
        .arg(root.join("model").join(format!("{name}.json")))
        .arg("-o")
        .arg(root.join(format!("out{run}")))
        .args(["--threads", "2"])
        .stderr(Stdio::null())
        .spawn()
        .expect("the program runs");
    let mut megabytes = 0.0f64;
    let status = loop {
        megabytes = megabytes.max(peak_of(child.id()).unwrap_or(0.0));
        if let Some(status) = child.try_wait().expect("a child") {
            break status;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    assert_eq!(status.code(), Some(1), "a mismatch is to be found");
    Spent { seconds: start.elapsed().as_secs_f64(), megabytes }
}

/// High-water mark of the process's resident memory, MB; `None` where there is no /proc.
fn peak_of(process: u32) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0 / 1e6)
}
