use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::correct::{CorrectOptions, Corrected, correct_recording, is_uncertainty};
use kinoise::io::{DESCRIPTION, Leaves, OutputFolder, refuse_nested};
use kinoise::units::counted;
use kinoise::{DepthCode, NoiseModel};

use super::common::{Global, Input};
use super::console::{beside, detail_model, next_step, notes, result, say, working};
use super::output::{UNCERTAINTY, begin};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise correct recording -m out/diagnosis/model.json -o corrected
  kinoise correct recording -m out/diagnosis/model.json -o corrected --sigma uncertainty")]
pub struct Arguments {
    /// A recording, a TUM folder, a fakenect dump, a folder of 16-bit PNGs, a ROS bag (.bag, .mcap, .db3),
    /// or a NumPy stack (.npy, .npz)
    recording: PathBuf,
    /// New folder for the corrected recording
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// model.json of this sensor, as kinoise diagnose writes it
    #[arg(short, long, value_name = "FILE")]
    model: PathBuf,
    /// Keep raw disparities in their code: the corrected depth is rounded to its steps again
    #[arg(long)]
    keep_code: bool,
    /// Also write the standard uncertainty of each corrected depth into this new folder: 16-bit
    /// images, 10 um a unit
    #[arg(long, value_name = "DIR")]
    sigma: Option<PathBuf>,
    #[command(flatten, next_help_heading = super::INPUT_HEADING)]
    input: Input,
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let model = NoiseModel::read(&arguments.model)?;
    detail_model(&model, Some(&arguments.model));
    let recording: &Path = &arguments.recording;
    let assumed = arguments.input.assumed()?;
    let inputs: [&Path; 2] = [recording, &arguments.model];
    let new = |place: &Path, leaves| begin(place, leaves, &inputs, global);
    if let Some(sigma) = &arguments.sigma {
        refuse_nested(sigma, &arguments.output)?;
    }
    let output = new(&arguments.output, Leaves::RECORDING)?;
    let sigma = arguments.sigma.as_deref();
    // What another command left there is not replaced.
    let foreign = |place: &Path| place.join("sigma.json").exists() && !is_uncertainty(place);
    let leaves = |place| if foreign(place) { Leaves::Images { marks: &[] } } else { UNCERTAINTY };
    let uncertainty = sigma.map(|place| new(place, leaves(place))).transpose()?;
    let corrected = working("correcting", |step| {
        let sigma = uncertainty.as_ref().map(OutputFolder::path);
        let options = CorrectOptions { keep_code: arguments.keep_code, sigma };
        correct_recording(recording, &assumed, &model, output.path(), &options, step)
    })?;
    uncertainty.map_or(Ok(()), OutputFolder::finish)?;
    output.finish()?;
    report(&corrected, arguments);
    global.print_json(&serde_json::json!({
        "frames": corrected.frames,
        "pixels": corrected.measured,
        "pixels_changed": corrected.changed,
        "rms_shift_mm": 1e3 * corrected.rms_shift_m,
        "clamped": corrected.clamped,
        "units_per_metre": match corrected.code {
            DepthCode::Metric { units_per_metre, .. } => Some(units_per_metre),
            DepthCode::Disparity { .. } => None,
        },
        "not_corrected": corrected.ignored,
        "output": arguments.output,
    }))?;
    let output = &arguments.output;
    // A film by a moving camera is mapped, without the model: its biases are already removed.
    let is_film = ["rgb.txt", "groundtruth.txt"].iter().any(|name| output.join(name).is_file());
    let (command, suffix) = if is_film { ("map", "map") } else { ("diagnose", "diagnosis") };
    let to = beside(output, suffix);
    let next = [command.into(), output.into(), "-o".into(), to.into()];
    let described = output.join(DESCRIPTION).is_file();
    let input = if described { Vec::new() } else { arguments.input.again() };
    next_step(&[&next[..], &input].concat());
    Ok(())
}

fn report(corrected: &Corrected, arguments: &Arguments) {
    let Corrected { changed, measured, frames, clamped, ignored, .. } = corrected;
    notes(&corrected.remarks);
    if !ignored.is_empty() {
        let left = each_once(ignored);
        say(format!("note: left in, because they are noise or belong to the scene: {left}"));
    }
    if *changed == 0 {
        say(format!("note: {} holds no bias that changes a depth here", arguments.model.display()));
    }
    if *clamped > 0 {
        say(format!(
            "note: {clamped} corrected depths lie beyond the range of the depth code and are clamped to it"
        ));
    }
    let (rms_mm, output) = (1e3 * corrected.rms_shift_m, arguments.output.display());
    result(format!(
        "corrected {changed} of {measured} depths in {} by {rms_mm:.2} mm (root mean square); wrote {output}",
        counted(*frames, "frame")
    ));
}

/// Each name once, with its number of occurrences.
fn each_once(names: &[String]) -> String {
    let first = names.iter().enumerate().filter(|(i, name)| !names[..*i].contains(name));
    let times = |(_, name): (usize, &String)| match names.iter().filter(|n| *n == name).count() {
        1 => name.clone(),
        n => format!("{name} ({n} times)"),
    };
    first.map(times).collect::<Vec<_>>().join(", ")
}
