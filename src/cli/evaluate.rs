use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};
use clap::{Args, ValueEnum};
use kinoise::evaluate::{Delta, Evaluation, Spread, clock_offset, evaluate};
use kinoise::io::{Assumed, OutputFolder, pretty_json};
use kinoise::report::{Against, Origin, evaluation_page};
use kinoise::sequence::open;
use kinoise::trajectory::{Pose, read_benchmark};
use kinoise::units::{counted, shortest};
use serde_json::{Value, json};

use super::common::{Global, MAX_FRAMES, between};
use super::console::{notes, result, say};
use super::origin::origin;
use super::output::{EVALUATION, begin};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise evaluate --truth groundtruth.txt --estimate out/desk/trajectory.txt
  kinoise evaluate --truth groundtruth.txt --estimate out/desk/trajectory.txt --delta 30 --delta-unit f
  kinoise evaluate --truth groundtruth.txt --estimate out/desk/trajectory.txt --offset auto")]
pub struct Arguments {
    /// Folder for evaluation.json, the plots and report.html
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// True poses in the TUM format, or the folder of a sequence
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// Estimated poses in the TUM format, or the folder of kinoise map
    #[arg(long, value_name = "FILE")]
    estimate: PathBuf,
    /// The interval over which the relative error is taken
    #[arg(long, value_name = "N", default_value_t = 1.0, allow_hyphen_values = true, value_parser = between(DELTA_S[0], MAX_FRAMES as f64, "s or frames"))]
    delta: f64,
    /// The unit of that interval
    #[arg(long, value_enum, default_value = "s", value_name = "UNIT")]
    delta_unit: Unit,
    /// Seconds to add to the estimate's times first, or auto: as many as both trajectories' turning
    /// says (it is found always, and told where it is significant)
    #[arg(long, value_name = "S|auto", value_parser = offset, allow_hyphen_values = true)]
    offset: Option<Offset>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Unit {
    /// Seconds
    S,
    /// Frames
    F,
}

#[derive(Debug, Clone, Copy)]
enum Offset {
    Seconds(f64),
    Auto,
}

/// For the test of all options.
#[cfg(test)]
pub fn offset_type() -> std::any::TypeId {
    std::any::TypeId::of::<Offset>()
}

fn offset(text: &str) -> Result<Offset, String> {
    if text == "auto" {
        return Ok(Offset::Auto);
    }
    let seconds = between(-MAX_OFFSET_S, MAX_OFFSET_S, "s")(text);
    seconds.map(Offset::Seconds).map_err(|why| format!("{why}, or auto"))
}

/// Three hundred years: covers the offset of a clock counting from 1970 to one counting from power-on.
const MAX_OFFSET_S: f64 = 1e10;
/// Range of an interval: from a time stamp's last digits to a day, s.
const DELTA_S: [f64; 2] = [1e-3, 86_400.0];

impl Arguments {
    /// Seconds to add to the estimate's times.
    fn shift(&self, truth: &[Pose], estimate: &[Pose]) -> anyhow::Result<f64> {
        match self.offset {
            None => Ok(0.0),
            Some(Offset::Seconds(seconds)) => Ok(seconds),
            Some(Offset::Auto) => match clock_offset(truth, estimate) {
                Some(found) => Ok(found.seconds),
                None => bail!(
                    "--offset auto: no offset within half a second explains how both turn (which needs 30 motions of 0.1 s, from poses more often than 5 times a second, and true poses more often than 10 times); give --offset in seconds"
                ),
            },
        }
    }

    fn delta(&self) -> anyhow::Result<Delta> {
        let (delta, shown, [low, high]) = (self.delta, shortest(self.delta), DELTA_S);
        let frames = (1.0..=MAX_FRAMES as f64).contains(&delta) && delta.fract() == 0.0;
        match self.delta_unit {
            Unit::S if (low..=high).contains(&delta) => Ok(Delta::Seconds(delta)),
            Unit::F if frames => Ok(Delta::Frames(delta as usize)),
            Unit::S => bail!("--delta {shown}: give a number of seconds from {low} to {high}"),
            Unit::F => {
                bail!("--delta {shown}: give a whole number of frames from 1 to {MAX_FRAMES}")
            }
        }
    }
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let delta = arguments.delta()?;
    let estimate_file = file_in(&arguments.estimate, "trajectory.txt");
    let [truth, mut estimate] = [truth_in(&arguments.truth)?, read_benchmark(&estimate_file)?];
    let inputs = [&*arguments.truth, &*estimate_file];
    let new = |place: &PathBuf| begin(place, EVALUATION, &inputs, global);
    let output = arguments.output.as_ref().map(new).transpose()?;
    let shift = arguments.shift(&truth, &estimate)?;
    if arguments.offset.is_some() {
        estimate.iter_mut().for_each(|pose| pose.stamp += shift);
        say(format!("the estimate's clock is set by {:+.1} ms", 1e3 * shift));
    }
    let evaluation = evaluate(&truth, &estimate, delta)?;
    report(&evaluation, delta);
    if let Some(output) = output {
        let against =
            Against { truth: &truth, estimate: &estimate, evaluation: &evaluation, delta };
        let origin = origin(&arguments.estimate, global.seed().0);
        write(&against, output, &origin)?;
    }
    global.print_json(&as_json(&evaluation))
}

/// True poses of a file, or of a sequence's folder: 7-Scenes has one file per pose.
fn truth_in(path: &Path) -> anyhow::Result<Vec<Pose>> {
    let file = file_in(path, "groundtruth.txt");
    if !path.is_dir() || file.is_file() {
        return Ok(read_benchmark(&file)?);
    }
    let truth = open(path, &Assumed::default())?.truth;
    ensure!(
        !truth.is_empty(),
        "{}: no true poses in this folder; give a file of them",
        path.display()
    );
    Ok(truth)
}

/// If `path` is a folder, the file `name` in it.
fn file_in(path: &Path, name: &str) -> PathBuf {
    if path.is_dir() { path.join(name) } else { path.to_path_buf() }
}

fn write(against: &Against<'_>, output: OutputFolder, origin: &Origin) -> anyhow::Result<()> {
    output.write("evaluation.json", pretty_json(&as_json(against.evaluation))?.as_bytes())?;
    for (name, chart) in against.charts() {
        output.write(name, chart.svg()?.as_bytes())?;
    }
    output.write("report.html", evaluation_page(against, origin)?.as_bytes())?;
    let page = output.place().join("report.html");
    output.finish()?;
    say(format!("wrote {}", page.display()));
    Ok(())
}

fn report(evaluation: &Evaluation, delta: Delta) {
    let line = |name: &str, s: &Spread, unit: &str| {
        let figures = s.figures().map(|(figure, v)| format!("{figure} {v:.6}")).join("  ");
        result(format!("{name} {unit}: {figures}  of {}", counted(s.pairs, "pair")));
    };
    let interval = format!("RPE over {delta},");
    line("ATE after alignment,", &evaluation.ate.error, "m");
    line(&interval, &evaluation.rpe.translation, "m");
    line(&interval, &evaluation.rpe.rotation.scaled(1f64.to_degrees()), "degrees");
    notes(&evaluation.remarks);
}

/// ATE and RPE, named as by the TUM scripts.
pub fn as_json(evaluation: &Evaluation) -> Value {
    let mut value = json!({
        "ate": evaluation.ate.error.json("_m"),
        "rpe_translation": evaluation.rpe.translation.json("_m"),
        "rpe_rotation": evaluation.rpe.rotation.scaled(1f64.to_degrees()).json("_deg"),
    });
    if let Some(offset) = evaluation.offset {
        value["clock_offset"] =
            json!({"seconds": offset.seconds, "std_error_s": offset.std_error_s});
    }
    if !evaluation.remarks.is_empty() {
        value["remarks"] = json!(evaluation.remarks);
    }
    value
}
