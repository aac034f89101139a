use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::calibrate::paper_model;
use kinoise::diagnose::{
    DiagnoseOptions, Diagnosed, Diagnosis, Field, Verdict, ViewPictures, diagnose,
    diagnose_against, pictures,
};
use kinoise::effects::{Active, Instant};
use kinoise::io::{Assumed, DESCRIPTION, OutputFolder, open, pretty_json};
use kinoise::report::{DiagnosisPage, diagnosis_page, story, subject};
use kinoise::simulate::{FormulaSensor, plan_on};
use kinoise::view::ViewNotes;
use kinoise::{Form, NoiseModel, Recording, Seed, Sensor};

use super::common::{Global, Input, say_differences, source_date};
use super::console::{
    detail, detail_model, detail_recording, next_command, notes, one_line, result_lines, say,
    working,
};
use super::diagnose_next::After;
use super::origin::origin;
use super::output::{DIAGNOSIS, begin};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise diagnose recording -o out/diagnosis
  kinoise diagnose recording -o out/difference --against simulated")]
pub struct Arguments {
    /// A recording, a TUM folder, a fakenect dump, a folder of 16-bit PNGs, a ROS bag (.bag, .mcap, .db3),
    /// or a NumPy stack (.npy, .npz)
    recording: PathBuf,
    /// Folder for diagnosis.json, model.json and report.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Hold the recording against this model [default: one calibrated on the recording itself]
    #[arg(short, long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Hold the recording against a simulated one of the same views (kinoise simulate --like)
    #[arg(long, value_name = "SIMULATED_REC", conflicts_with = "model")]
    against: Option<PathBuf>,
    /// Exit with 0, not 1, when a mismatch was found
    #[arg(long)]
    exit_zero: bool,
    #[command(flatten, next_help_heading = super::INPUT_HEADING)]
    input: Input,
}

/// Below this share of the sigmas' variance a fit explains nothing.
const MIN_R2: f64 = 0.5;
/// Exit code when a mismatch was found.
const FOUND: u8 = 1;

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<u8> {
    let assumed = arguments.input.assumed()?;
    let recording = open(&arguments.recording, &assumed)?;
    // A simulated recording describes itself, even beside a folder that does not.
    let described = |path: &Path| path.join(DESCRIPTION).is_file();
    let other = |path: &PathBuf| match described(path) && !described(&arguments.recording) {
        true => open(path, &Assumed::default()),
        false => open(path, &assumed),
    };
    let simulated = arguments.against.as_ref().map(other).transpose()?;
    let others = [&arguments.against, &arguments.model].into_iter().flatten();
    let inputs: Vec<&Path> = others.chain([&arguments.recording]).map(PathBuf::as_path).collect();
    let out = begin(&arguments.output, DIAGNOSIS, &inputs, global)?;
    detail_recording(&recording);
    let model = match (&arguments.model, &simulated) {
        (Some(path), _) => {
            let model = NoiseModel::read(path)?;
            model.refuse_other_size(&recording.sensor).map_err(|e| e.of(path))?;
            say_differences(path, &model, &recording.sensor);
            model
        }
        (None, Some(simulated)) => weights(&recording, simulated, global)?,
        (None, None) => {
            say("no --model was given: it is calibrated on this recording first");
            calibrated(&recording, global)?
        }
    };
    detail_model(&model, arguments.model.as_deref());
    let options = DiagnoseOptions {
        seed: global.seed(),
        calibrated_here: arguments.model.is_none() && simulated.is_none(),
        ..DiagnoseOptions::default()
    };
    let held = HeldAgainst {
        simulated: simulated.as_ref(),
        model: &model,
        options: &options,
        input: arguments.input.again(),
    };
    let diagnosis = examine(&recording, &held, out)?;
    global.print_json(&serde_json::to_value(&diagnosis)?)?;
    let after = After {
        diagnosis: &diagnosis,
        recording: &arguments.recording,
        folder: &arguments.output,
        input: &held.input,
    };
    after.reproductions(arguments.model.as_deref(), &model.effects).iter().for_each(say);
    after.steps().iter().take(1).for_each(|step| next_command(&step.command));
    let found = diagnosis.verdict == Verdict::Mismatch && !arguments.exit_zero;
    Ok(if found { FOUND } else { 0 })
}

/// What a recording is compared with, and how.
pub struct HeldAgainst<'a> {
    pub simulated: Option<&'a Recording>,
    pub model: &'a NoiseModel,
    pub options: &'a DiagnoseOptions,
    /// Input options of the recording, for other commands.
    pub input: Vec<OsString>,
}

/// Diagnoses, writes every output and reports.
pub fn examine(
    recording: &Recording,
    held: &HeldAgainst<'_>,
    out: OutputFolder,
) -> anyhow::Result<Diagnosis> {
    let HeldAgainst { simulated, model, options, ref input } = *held;
    detail(format!("settings: {options:?}"));
    let done = working("measuring the views", |step| match simulated {
        Some(simulated) => diagnose_against(recording, simulated, model, options, step),
        None => diagnose(recording, model, options, step),
    })?;
    let diagnosis = &done.diagnosis;
    let json = serde_json::to_value(diagnosis)?;
    out.write("diagnosis.json", pretty_json(&json)?.as_bytes())?;
    done.model.write(&out.path().join("model.json"))?;
    let title = format!("What the {} of {} leaves out", subject(diagnosis), recording.sensor.name);
    working("drawing the page", |_| -> anyhow::Result<()> {
        let pictures = with_twins(&done, &recording.sensor, model, options.seed);
        let origin = &origin(&recording.root, options.seed.0);
        let after = After { diagnosis, recording: &recording.root, folder: out.place(), input };
        let steps = after.steps();
        let page =
            DiagnosisPage { title: &title, diagnosis, pictures: &pictures, steps: &steps, origin };
        out.write("report.html", diagnosis_page(&page)?.as_bytes())?;
        Ok(())
    })?;
    out.finish()?;
    notes(&done.excluded);
    result_lines(summary(diagnosis));
    Ok(done.diagnosis)
}

fn calibrated(recording: &Recording, global: &Global) -> anyhow::Result<NoiseModel> {
    let step =
        |step: kinoise::Progress<'_>| paper_model(recording, global.seed(), source_date(), step);
    let model = working("calibrating", step).map_err(|e| e.of(&recording.root))?;
    if model.sigma.form != Form::Paper {
        model.fit.remarks.iter().take(1).for_each(|why| say(format!("note: {why}")));
    }
    if model.fit.r2 < MIN_R2 {
        let (r2, check) = (model.fit.r2, "how raw values become metres, and the intrinsics");
        say(format!(
            "note: the model calibrated here explains little of the noise (r2 {r2:.2}): check {check}"
        ));
    }
    Ok(model)
}

/// The sigma to weight by: the simulation's own, or the recording's where that cannot be calibrated.
fn weights(
    recording: &Recording,
    simulated: &Recording,
    global: &Global,
) -> anyhow::Result<NoiseModel> {
    calibrated(simulated, global).or_else(|why| {
        say(format!("note: sigma was calibrated on the recording; on the simulated one: {why:#}"));
        calibrated(recording, global)
    })
}

fn summary(diagnosis: &Diagnosis) -> String {
    let it = subject(diagnosis);
    let mut text = match diagnosis.verdict {
        Verdict::Match => format!("match: nothing was found that the {it} leaves out\n"),
        Verdict::Inconclusive => {
            "inconclusive: nothing was found, and these views do not settle whether there is something\n".to_string()
        }
        Verdict::Mismatch if diagnosis.findings.iter().any(|f| f.contradicted.is_some()) => {
            format!("mismatch: the {it} does not fit the recording\n")
        }
        Verdict::Mismatch => format!("mismatch: the {it} leaves out\n"),
    };
    for sentence in story(diagnosis) {
        text += &format!("  {}\n", one_line(&sentence));
    }
    text.trim_end().to_string()
}

/// Effects that move the plane as a whole: a picture of residuals about the plane does not show them.
const OF_THE_PLANE: [&str; 3] = ["depth-scale", "disparity-offset", "thermal-drift"];
/// More frames of a twin add nothing visible.
const MAX_TWIN_FRAMES: usize = 16;

/// Pictures of the views worth seeing, each with its simulated twin. `given` is the model that the
/// recording was compared with.
fn with_twins(
    done: &Diagnosed,
    sensor: &Sensor,
    given: &NoiseModel,
    seed: Seed,
) -> Vec<ViewPictures> {
    let mut effects = done.model.effects.clone();
    effects.retain(|e| {
        let is_known = Active::all_of_model(std::slice::from_ref(e)).is_ok();
        is_known && !OF_THE_PLANE.contains(&e.id.as_str())
    });
    let effects = Active::all_of_model(&effects).unwrap_or_default();
    let (rays, sigma) = (sensor.camera.rays(), &done.model.sigma);
    let camera = FormulaSensor { sensor, rays: &rays, sigma, effects: &effects, seed };
    let session_s = done.fields.first().map_or(0.0, |f| f.time_s - f.session_s);
    let retake = |index, field: &Field| {
        // Beside a simulated recording, the fields are already differences.
        if !done.against.is_empty() {
            return None;
        }
        let times = field.frames.iter().take(MAX_TWIN_FRAMES).map(|f| f.0);
        let stamps = times.map(|t| field.time_s + t).collect();
        let notes = ViewNotes {
            temperature_c: field.temperature_c,
            ambient_lux: field.ambient_lux,
            ..ViewNotes::default()
        };
        let plan = plan_on(&field.name, &field.plane, &field.pixels, &rays, stamps, notes);
        let seen = plan.seen(&sensor.camera, &rays);
        let mut shooting = camera.begin(&seen);
        (shooting.ambient_lux, shooting.temperature_c) =
            (plan.ambient_lux, plan.notes.temperature_c);
        let shot = |(_, instant): (f64, Instant)| (instant.view_s, shooting.shoot(instant).depth);
        Some(plan.instants(index, session_s).map(shot).collect())
    };
    pictures(done, sensor, given, &retake)
}
