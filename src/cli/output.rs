//! What each command leaves in its folder, and what Ctrl-C leaves of it.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use kinoise::io::{Interrupted, Leaves, OutputFolder, discard_unfinished};

use super::common::Global;
use super::console::result;

/// The files of results; the first of them no other command writes.
macro_rules! results {
    ($mark:literal $(, $name:literal)*) => {
        Leaves::Results { names: &[&[$mark $(, $name)*]], marks: &[$mark] }
    };
}

const CALIBRATED: &[&str] = &[
    "model.json",
    "measurements.csv",
    "sigma.svg",
    "sigma.png",
    "sigma_map.svg",
    "sigma_map.png",
    "report.html",
];

/// Of `calibrate` and `fit`; without a fit the measurements stand alone.
pub const CALIBRATION: Leaves =
    Leaves::Results { names: &[CALIBRATED], marks: &["measurements.csv", "sigma.svg"] };

pub const DIAGNOSIS: Leaves = results!("diagnosis.json", "model.json", "report.html");

pub const MAP: Leaves =
    results!("trajectory.txt", "map.ply", "map.html", "frames.csv", "stats.json");

pub const COMPARISON: Leaves = results!(
    "tables.json",
    "tables.txt",
    "fig6_paths.svg",
    "fig7_ate.svg",
    "fig8_rpe.svg",
    "report.html"
);

pub const EVALUATION: Leaves =
    results!("evaluation.json", "ate.svg", "rpe.svg", "paths.svg", "report.html");

pub const METRICS: Leaves = results!("metrics.json", "report.html");

pub const SIGMA: Leaves = results!("sigma.txt", "sigma", "sigma.json");

/// A page of the manual for the program and one a command.
pub const PAGES: Leaves = results!("kinoise.1", "kinoise-");

/// A calibration with the rest of the road in folders beside it.
pub const DEMO: Leaves = Leaves::Results {
    names: &[
        CALIBRATED,
        &["diagnosis", "map", "map-plain", "office-", "sealed", "sealed.txt", "sealed.sha256"],
    ],
    marks: &["measurements.csv"],
};

/// The folder that a command fills; `inputs` are what it reads.
pub fn begin(
    place: &Path,
    leaves: Leaves,
    inputs: &[&Path],
    global: &Global,
) -> kinoise::Result<OutputFolder> {
    OutputFolder::begin(place, leaves, inputs, global.force)
}

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Sooner than a person notices, and no load.
const POLL: Duration = Duration::from_millis(50);

/// From here on a file that grows beyond its limit (`ulimit -f`) is an error of the write, as on a full
/// disk, and not the end of the process.
pub fn survive_file_limits() -> std::io::Result<()> {
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())?;
    Ok(())
}

/// From here on Ctrl-C and a polite kill throw away what is not whole, say what is kept, and end the
/// process as they would have.
pub fn discard_when_interrupted() -> std::io::Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let caught = Arc::new(AtomicUsize::new(0));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_usize(signal, caught.clone(), signal as usize)?;
    }
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(POLL);
            let signal = caught.load(Ordering::Relaxed);
            if signal != 0 {
                INTERRUPTED.store(true, Ordering::SeqCst);
                result(describe(&discard_unfinished()));
                let _ = signal_hook::low_level::emulate_default_handler(signal as i32);
            }
        }
    });
    Ok(())
}

/// An error of a run whose folder was just taken away is no news: wait for the end.
pub fn wait_if_interrupted() {
    while INTERRUPTED.load(Ordering::SeqCst) {
        std::thread::sleep(POLL);
    }
}

fn describe(found: &Interrupted) -> String {
    let mut text = String::from("kinoise: interrupted");
    for (place, stood) in &found.discarded {
        let left = if *stood { "is as it was" } else { "was not written" };
        let _ = write!(text, "; {} {left}", place.display());
    }
    for place in &found.kept {
        let _ = write!(text, "; {} is whole and kept", place.display());
    }
    text
}
