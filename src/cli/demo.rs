use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::diagnose::DiagnoseOptions;
use kinoise::io::{Assumed, open};
use kinoise::map::{Init, Options, Weights};
use kinoise::measure::MeasureOptions;
use kinoise::report::Overlay;
use kinoise::sequence;
use kinoise::simulate::room::{Film, Room, around_the_desks};
use kinoise::{CalibrateOptions, Form, NoiseModel, Recording, SigmaModel};

use super::calibrate::calibrate;
use super::calibrate_summary::as_json;
use super::common::{Global, say, source_date};
use super::diagnose::{HeldAgainst, examine};
use super::map::follow;

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
        created: source_date(),
        ..CalibrateOptions::default()
    };
    let (measured, calibration) =
        calibrate(&recording, &options, &arguments.output, &Overlay::ALL[..1])?;
    let model = &calibration.model;
    say(format!(
        "The recording was made with the paper's Eq. 1, so the first two columns should agree.\nOpen {} to see it all.",
        arguments.output.join("report.html").display()
    ));
    say("\nIs there anything that this model leaves out? There should not be:");
    let diagnosis = arguments.output.join("diagnosis");
    let options = DiagnoseOptions {
        seed: global.seed(),
        calibrated_here: true,
        ..DiagnoseOptions::default()
    };
    let held = HeldAgainst { simulated: None, model, options: &options };
    examine(&recording, &held, &diagnosis, global)?;
    say(format!(
        "{} says how small an error would have been seen.",
        diagnosis.join("report.html").display()
    ));
    mapped(&recording, model, &arguments.output, global)?;
    global.print_json(&as_json(&calibration, Some(&measured)))
}

/// Frames of the film: two seconds.
const FRAMES: usize = 60;

/// An office filmed through the same sensor, mapped without a model and with it.
fn mapped(
    recording: &Recording,
    model: &NoiseModel,
    output: &Path,
    global: &Global,
) -> anyhow::Result<()> {
    say("\nWhat is it good for? An office, filmed through the same sensor:");
    // The same seed makes the same film: one that is there already will do.
    let folder = output.join(format!("office-{}", global.seed().0));
    if !folder.join("groundtruth.txt").is_file() {
        let film = Film {
            sensor: recording.sensor.clone(),
            room: Room::office(global.seed()),
            poses: around_the_desks().into_iter().take(FRAMES).collect(),
            sigma: SigmaModel::paper(),
            effects: Vec::new(),
            seed: global.seed(),
        };
        film.write(&folder, &|_, _| ())?;
    }
    let sequence = sequence::open(&folder, &Assumed::default())?;
    let plain = Options { seed: global.seed(), ..Options::paper(Weights::None, Init::None) };
    let best = Options { seed: global.seed(), ..Options::best() };
    say("point-to-plane ICP from frame to frame, without the model:");
    follow(&sequence, model, &plain, "The office, plain ICP", &output.join("map-plain"))?;
    say("with the model, each frame to the map so far:");
    follow(&sequence, model, &best, "The office", &output.join("map"))?;
    say(format!("Open {} and turn it.", output.join("map/map.html").display()));
    Ok(())
}

/// calib_data/ beside the caller, or in the source tree this program was built from.
fn bundled() -> anyhow::Result<PathBuf> {
    let places =
        [Path::new("calib_data"), Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/calib_data"))];
    places.iter().map(|p| p.join(BUNDLED)).find(|p| p.is_dir()).ok_or_else(|| {
        anyhow::anyhow!("calib_data/{BUNDLED} is not here; run the demo from the project's folder")
    })
}
