use std::path::{Path, PathBuf};
use std::time::SystemTime;

use anyhow::Context;
use clap::Args;
use kinoise::diagnose::{DiagnoseOptions, Diagnosis};
use kinoise::io::{Assumed, Leaves, OutputFolder, open, write_atomic};
use kinoise::map::{Init, Options, Weights};
use kinoise::measure::MeasureOptions;
use kinoise::report::Overlay;
use kinoise::scene::{Board, PATCH_SIDE_M, Print, Target};
use kinoise::sequence;
use kinoise::simulate::room::{Film, Room, around_the_desks};
use kinoise::simulate::{Grid, Physics, Scenery, Shoot, plan_grid};
use kinoise::units::counted;
use kinoise::{
    CalibrateOptions, Form, Measurements, NoiseModel, Recording, Seed, Sensor, SigmaModel,
};

use super::calibrate::calibrate;
use super::calibrate_summary::as_json;
use super::common::{Global, source_date};
use super::console::{next_step, result, result_lines, say, say_lines, shell, working};
use super::demo_seal::Sealed;
use super::diagnose::{HeldAgainst, examine};
use super::map::follow;
use super::output::{DEMO, DIAGNOSIS, MAP, SEAL, begin};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise demo
  kinoise demo -o out/again --seed 7")]
pub struct Arguments {
    /// Folder for the results
    #[arg(short, long, default_value = "out/demo", value_name = "DIR")]
    output: PathBuf,
}

/// The bundled recording: Gaussian noise of the paper's Eq. 1 on the paper's grid.
const BUNDLED: &str = "eq1-paper-grid";

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let output = &arguments.output;
    let seed = Seed(global.seed.unwrap_or_else(clock));
    say("1. Calibrate: how noisy is the sensor of the bundled recording?\n");
    let sealed = Sealed::draw(seed)?;
    let (recording, measured, calibration) = calibrated(seed, &sealed, output, global)?;
    let model = &calibration.model;
    say(
        "The recording was simulated with the paper's Eq. 1, so the first two columns should agree.",
    );
    say(format!("Open {} to see it all.", output.join("report.html").display()));

    say("\n2. Diagnose: the same sensor once more, with one more cause that nobody has chosen.\n");
    let film = output.join("sealed");
    say_lines(sealed.promise());
    filmed(&sealed, &recording.sensor, &model.sigma, &film, seed)?;
    let (diagnosis, page) = diagnosed(&film, model, output, seed, global)?;
    write_atomic(&output.join("sealed.txt"), sealed.text().as_bytes())?;
    let (text, json) = sealed.opened(&diagnosis);
    result_lines(text);
    let check = shell(&["sha256sum".into(), output.join("sealed.txt").into()]);
    say(format!("Check the hash with: {check}"));
    say(format!("Open {} to see how.", page.display()));

    mapped(&recording, model, output, global)?;
    let mut value = as_json(&calibration, Some(&measured));
    value["sealed"] = json;
    value["seed"] = seed.0.into();
    global.print_json(&value)?;
    say(format!("\nThis run again: kinoise demo --seed {}", seed.0));
    next_step(
        &["capture", "my-kinect", "--source", "freenect", "--views", "quick"].map(Into::into),
    );
    Ok(())
}

/// A seed from the clock, ms.
fn clock() -> u64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.map_or(1, |t| t.as_millis() as u64)
}

/// Calibrates; the hash of the sealed text lies beside the results before anything is filmed.
fn calibrated(
    seed: Seed,
    sealed: &Sealed,
    output: &Path,
    global: &Global,
) -> anyhow::Result<(Recording, Measurements, kinoise::Calibration)> {
    let path = bundled()?;
    let recording = open(&path, &Assumed::default())?;
    let out = begin(output, DEMO, &[&path], global)?;
    out.write(SEAL, sealed.promised().as_bytes())?;
    let options = CalibrateOptions {
        measure: MeasureOptions { seed, ..MeasureOptions::default() },
        form: Some(Form::Paper),
        created: source_date(),
        ..CalibrateOptions::default()
    };
    let (measured, calibration) = calibrate(&recording, &options, out, &Overlay::ALL[..1])?;
    Ok((recording, measured, calibration))
}

/// Enough to show temporal correlation of the noise.
const FRAMES_A_VIEW: usize = 4;

/// Films the board in a scene where every effect of the catalogue has something to act on: a print of
/// several greys and its infrared picture, a wall behind, distances by a tape, a thermometer and a light
/// meter.
fn filmed(
    sealed: &Sealed,
    sensor: &Sensor,
    sigma: &SigmaModel,
    folder: &Path,
    seed: Seed,
) -> anyhow::Result<()> {
    let distances_m = vec![1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0];
    let tilts_rad = [0.0f64, 35.0, 60.0, 74.0].map(f64::to_radians).to_vec();
    let azimuths = [0.0f64, 100.0].map(f64::to_radians);
    let poses = Grid { distances_m, tilts_rad }.views_towards(&azimuths);
    let scenery = Scenery {
        print: Print::Patches(PATCH_SIDE_M),
        wall_gap_m: Some(0.6),
        reference_error_m: Some(0.003),
        conditions: true,
        ..Scenery::bare(Target::Board(Board { width_m: 1.0, height_m: 0.8 }))
    };
    let shoot = Shoot {
        sensor: sensor.clone(),
        views: plan_grid(&poses, &scenery, FRAMES_A_VIEW, true, seed),
        physics: Physics::Formula { sigma: sigma.clone(), effects: vec![sealed.effect.clone()] },
        infrared: true,
        seed,
    };
    let out = own(folder)?;
    working("filming", |step| shoot.write_quickly(out.path(), step))?;
    out.finish()?;
    let (views, folder) = (counted(shoot.views.len(), "view"), folder.display());
    say(format!("filmed {views} of {FRAMES_A_VIEW} frames with it: {folder}\n"));
    Ok(())
}

/// Begins a recording within the demo's folder, replacing that of an earlier demo.
fn own(folder: &Path) -> kinoise::Result<OutputFolder> {
    OutputFolder::begin(folder, Leaves::RECORDING, &[], true)
}

/// Diagnoses what the calibrated model leaves out of the film; also returns the page.
fn diagnosed(
    film: &Path,
    model: &NoiseModel,
    output: &Path,
    seed: Seed,
    global: &Global,
) -> anyhow::Result<(Diagnosis, PathBuf)> {
    let recording = open(film, &Assumed::default())?;
    let options = DiagnoseOptions { seed, ..DiagnoseOptions::default() };
    let folder = output.join("diagnosis");
    let held = HeldAgainst { simulated: None, model, options: &options, input: Vec::new() };
    let out = begin(&folder, DIAGNOSIS, &[film], global)?;
    let diagnosis = examine(&recording, &held, out).context("the sealed recording")?;
    Ok((diagnosis, folder.join("report.html")))
}

/// Frames of the film: two seconds.
const FRAMES: usize = 60;
/// Every run maps the same office, which is filmed once.
const OFFICE: Seed = Seed(1);

/// Films an office through the same sensor and maps it without the model and with it.
fn mapped(
    recording: &Recording,
    model: &NoiseModel,
    output: &Path,
    global: &Global,
) -> anyhow::Result<()> {
    let seed = OFFICE;
    say("\n3. Map: an office, filmed through the calibrated sensor.\n");
    let folder = output.join(format!("office-{}", seed.0));
    if !folder.join("groundtruth.txt").is_file() {
        let film = Film {
            sensor: recording.sensor.clone(),
            room: Room::office(seed),
            poses: around_the_desks().into_iter().take(FRAMES).collect(),
            physics: Physics::Formula { sigma: SigmaModel::paper(), effects: Vec::new() },
            seed,
        };
        let out = own(&folder)?;
        working("filming", |step| film.write(out.path(), step))?;
        out.finish()?;
    }
    let sequence = sequence::open(&folder, &Assumed::default())?;
    let plain = Options { seed, ..Options::paper(Weights::None, Init::None) };
    let best = Options { seed, ..Options::best() };
    result("point-to-plane ICP from frame to frame, without the model:");
    let named = |title| [title, "model.json of this demo"];
    let map = |name: &str| begin(&output.join(name), MAP, &[], global);
    follow(&sequence, model, &plain, named("The office, plain ICP"), map("map-plain")?)?;
    result("with the model, each frame to the map so far:");
    follow(&sequence, model, &best, named("The office"), map("map")?)?;
    say(format!("Open {} and turn it.", output.join("map/map.html").display()));
    Ok(())
}

/// calib_data/ in the current folder, or in the source tree this program was built from.
fn bundled() -> anyhow::Result<PathBuf> {
    let places =
        [Path::new("calib_data"), Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/calib_data"))];
    places.iter().map(|p| p.join(BUNDLED)).find(|p| p.is_dir()).ok_or_else(|| {
        anyhow::anyhow!("calib_data/{BUNDLED} is not here; run the demo from the project's folder")
    })
}
