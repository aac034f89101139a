use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::diagnose::{
    DiagnoseOptions, Diagnosis, Reference, Status, Verdict, diagnose, diagnose_against,
};
use kinoise::io::{OutputDir, open};
use kinoise::report::{DiagnosisPage, diagnosis_page};
use kinoise::terms::Statistic;
use kinoise::{CalibrateOptions, NoiseModel, Recording};

use super::common::{Bar, Global, Input, say, source_date};
use super::diagnose_pictures;

#[derive(Debug, Args)]
pub struct Arguments {
    /// A recording, a TUM folder, a fakenect dump, or a folder of 16-bit PNGs
    recording: PathBuf,
    /// The model to hold it against [default: one calibrated on the recording itself]
    #[arg(short, long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// A simulated recording of the same views to hold it against: what does that simulation leave out?
    #[arg(long, value_name = "SIMULATED_REC", conflicts_with = "model")]
    against: Option<PathBuf>,
    /// Folder for diagnosis.json, model.json and report.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    input: Input,
}

impl Arguments {
    /// Of a folder that describes itself.
    pub fn plain(
        recording: PathBuf,
        model: Option<PathBuf>,
        against: Option<PathBuf>,
        output: PathBuf,
    ) -> Self {
        Arguments { recording, model, against, output, input: Input::default() }
    }
}

/// Exit code where a mismatch was found.
const FOUND: u8 = 1;

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<u8> {
    let recording = open(&arguments.recording, &arguments.input.assumed()?)?;
    let simulated = match &arguments.against {
        Some(path) => Some(open(path, &arguments.input.assumed()?)?),
        None => None,
    };
    let model = match (&arguments.model, &simulated) {
        (Some(path), _) => NoiseModel::read(path)?,
        (None, Some(simulated)) => weights(&recording, simulated, global)?,
        (None, None) => {
            say("no --model given: calibrated on this recording first");
            calibrated(&recording, global)?
        }
    };
    let diagnosis = examine(&recording, simulated.as_ref(), &model, &arguments.output, global)?;
    global.print_json(&serde_json::to_value(&diagnosis)?)?;
    Ok(if diagnosis.verdict == Verdict::Mismatch { FOUND } else { 0 })
}

/// Diagnose, write every output, tell.
pub fn examine(
    recording: &Recording,
    simulated: Option<&Recording>,
    model: &NoiseModel,
    output: &Path,
    global: &Global,
) -> anyhow::Result<Diagnosis> {
    let out = OutputDir::create(output)?;
    let options = DiagnoseOptions { seed: global.seed(), ..DiagnoseOptions::default() };
    let bar = Bar::new("views");
    let step = |done, all| bar.step(done, all);
    let done = match simulated {
        Some(simulated) => diagnose_against(recording, simulated, model, &options, &step)?,
        None => diagnose(recording, model, &options, &step)?,
    };
    drop(bar);
    let diagnosis = &done.diagnosis;
    let json = serde_json::to_value(diagnosis)?;
    out.write("diagnosis.json", format!("{json:#}\n").as_bytes())?;
    done.model.write(&out.path().join("model.json"))?;
    let held_against = if simulated.is_some() { "simulation" } else { "model" };
    let title = format!("What the {held_against} of {} leaves out", recording.sensor.name);
    let pictures = diagnose_pictures::of(&done, &recording.sensor, model, global.seed());
    let page = DiagnosisPage { title: &title, diagnosis, pictures: &pictures };
    out.write("report.html", diagnosis_page(&page)?.as_bytes())?;
    say(words(diagnosis));
    Ok(done.diagnosis)
}

fn calibrated(recording: &Recording, global: &Global) -> anyhow::Result<NoiseModel> {
    let mut options = CalibrateOptions {
        form: Some(kinoise::Form::Paper),
        created: source_date(),
        ..Default::default()
    };
    options.measure.seed = global.seed();
    let bar = Bar::new("views");
    let views =
        kinoise::measure_recording(recording, &options.measure, &|done, all| bar.step(done, all))?;
    drop(bar);
    Ok(kinoise::model_of(recording, &views, &options)?.model)
}

/// The sigma to weigh by: the simulation's own, or the recording's where that has none.
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

fn words(diagnosis: &Diagnosis) -> String {
    let held_against = match diagnosis.reference {
        Reference::Model => "the model",
        Reference::SimulatedRecording => "the simulation",
    };
    let mut text = match diagnosis.verdict {
        Verdict::Match => format!("match: nothing was found that {held_against} leaves out\n"),
        Verdict::Inconclusive => "inconclusive: these views could not have shown it\n".to_string(),
        Verdict::Mismatch => format!("mismatch: {held_against} leaves out\n"),
    };
    for f in diagnosis.findings.iter().filter(|f| f.status != Status::NotIdentifiable) {
        let name = match (f.status, f.effect) {
            (Status::Recalibrate, _) => "sigma itself is off: calibrate again".to_string(),
            (Status::OneOf, _) => {
                let names: Vec<&str> = f.alternatives.iter().take(3).map(|a| a.effect).collect();
                names.join(" or ")
            }
            (_, Some(effect)) => effect.to_string(),
            (_, None) => format!("something without a name ({})", f.shape.as_deref().unwrap_or("")),
        };
        let parameters: Vec<String> = f
            .parameters
            .iter()
            .filter_map(|(k, v)| Some(format!("{k} {:.4}", v.get("value")?.as_f64()?)))
            .collect();
        let size = if f.statistic == Statistic::Dropout {
            format!("{:.1} % of the pixels lost", 100.0 * f.size.sigma)
        } else {
            format!("{:.2} mm, {:.2} sigma", f.size.mm, f.size.sigma)
        };
        text += &format!(
            "  {name}: {size}, {:.0} % of it; along {}{}{}\n",
            100.0 * f.share,
            f.axis,
            if parameters.is_empty() { "" } else { "; " },
            parameters.join(", ")
        );
    }
    if let Some(h) = &diagnosis.heldout {
        text += &format!(
            "on {} views kept aside: {:.1} nats a view gained [{:.1}, {:.1}], rms {:.3} -> {:.3} mm\n",
            h.views.len(),
            h.gain,
            h.gain_interval[0],
            h.gain_interval[1],
            h.rms_mm_before,
            h.rms_mm_after
        );
    }
    text
}
