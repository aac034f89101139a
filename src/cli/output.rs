//! The files that each command leaves in its folder, and what remains of them after Ctrl-C.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use kinoise::io::{Interrupted, Leaves, OutputFolder, discard_unfinished};

use super::common::Global;
use super::console::result;

/// Names of result files; no other command writes the first.
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

/// Files of `calibrate` and `fit`; without a fit, the measurements alone.
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

/// Of `correct --sigma`: folders like the recording's.
pub const UNCERTAINTY: Leaves = Leaves::Images { marks: &["sigma.json"] };

pub const SIGMA: Leaves = results!("sigma.txt", "sigma", "sigma.json");

/// Manual pages: one for the program and one per command.
pub const PAGES: Leaves = results!("kinoise.1", "kinoise-");

/// Hash of the demo's sealed text.
pub const SEAL: &str = "sealed.sha256";

/// A calibration, with the later stages of the demo in folders beside it.
pub const DEMO: Leaves = Leaves::Results {
    names: &[
        CALIBRATED,
        &["diagnosis", "map", "map-plain", "office-", "sealed", "sealed.txt", SEAL],
    ],
    marks: &[SEAL],
};

/// Begins the folder that a command fills; `inputs` are the files it reads.
pub fn begin(
    place: &Path,
    leaves: Leaves,
    inputs: &[&Path],
    global: &Global,
) -> kinoise::Result<OutputFolder> {
    OutputFolder::begin(place, leaves, inputs, global.force)
}

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Shorter than a person notices, and a negligible load.
const POLL: Duration = Duration::from_millis(50);

/// From here on, exceeding the file size limit (`ulimit -f`) is a write error, as on a full disk, and does
/// not kill the process.
pub fn survive_file_limits() -> std::io::Result<()> {
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())?;
    Ok(())
}

/// From here on, SIGINT (Ctrl-C) and SIGTERM discard unfinished output, report what is kept, and end the
/// process as they would by default.
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

/// After an interruption, waits for the process to end: the error of a run whose folder was just removed
/// is of no interest.
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
