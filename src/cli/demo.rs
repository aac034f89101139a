use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::io::{Assumed, open};
use kinoise::measure::MeasureOptions;
use kinoise::report::Overlay;
use kinoise::{CalibrateOptions, Form};

use super::calibrate::calibrate;
use super::common::{Global, say};
use super::diagnose::examine;
use super::words;

#[derive(Debug, Args)]
pub struct Arguments {
    /// Folder for the results
    #[arg(short, long, default_value = "out/demo", value_name = "DIR")]
    output: PathBuf,
}

/// The bundled recording: Gaussian noise of the paper's Eq. 1 on the paper's grid.
const BUNDLED: &str = "eq1-paper-grid";

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let path = bundled()?;
    let recording = open(&path, &Assumed::default())?;
    let options = CalibrateOptions {
        measure: MeasureOptions { seed: global.seed(), ..MeasureOptions::default() },
        form: Some(Form::Paper),
        ..CalibrateOptions::default()
    };
    let done = calibrate(&recording, &options, &arguments.output, &[Overlay::PaperEq1])?;
    say(format!(
        "The recording was made with the paper's Eq. 1, so the first two columns should agree.\nOpen {} to see it all.",
        arguments.output.join("report.html").display()
    ));
    say("\nIs there anything that this model leaves out? There should not be:");
    let told = arguments.output.join("diagnosis");
    examine(&recording, None, &done.calibration.model, &told, global)?;
    say(format!(
        "{} says how small an error would have been seen.",
        told.join("report.html").display()
    ));
    global.print_json(&words::as_json(&done.calibration, Some(&done.measurements)))
}

/// calib_data/ beside the caller, or in the source tree this program was built from.
fn bundled() -> anyhow::Result<PathBuf> {
    let places =
        [Path::new("calib_data"), Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/calib_data"))];
    places.iter().map(|p| p.join(BUNDLED)).find(|p| p.is_dir()).ok_or_else(|| {
        anyhow::anyhow!("calib_data/{BUNDLED} is not here; run the demo from the project's folder")
    })
}
