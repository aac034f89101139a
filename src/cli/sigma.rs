use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::NoiseModel;
use kinoise::correct::{SIGMA_UNITS_PER_METRE, sigma_images};
use kinoise::sequence::open;
use kinoise::units::counted;
use serde_json::json;

use super::common::{Global, Input, Thinning};
use super::console::{detail_model, notes, result, say, working};
use super::output::{SIGMA, begin};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise sigma rgbd_dataset_freiburg1_desk -m out/kinect/model.json -o out/desk-sigma
  kinoise sigma rgbd_dataset_freiburg1_desk -m out/kinect/model.json -o out/few --stride 10")]
pub struct Arguments {
    /// A sequence in the layout of the TUM RGB-D benchmark or of 7-Scenes, a ROS bag (.bag, .mcap, .db3), or a
    /// NumPy stack (.npy, .npz)
    sequence: PathBuf,
    /// Folder for sigma/*.png (16 bit, 10 um a unit, 0 for no depth), sigma.txt and sigma.json
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// model.json of this sensor
    #[arg(short, long, value_name = "FILE")]
    model: PathBuf,
    #[command(flatten)]
    thinning: Thinning,
    #[command(flatten, next_help_heading = super::INPUT_HEADING)]
    input: Input,
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let path: &Path = &arguments.sequence;
    let model = NoiseModel::read(&arguments.model)?;
    detail_model(&model, Some(&arguments.model));
    let output = begin(&arguments.output, SIGMA, &[path, &arguments.model], global)?;
    let mut sequence = open(path, &arguments.input.assumed()?)?;
    model.refuse_other_size(&sequence.sensor).map_err(|e| e.of(&arguments.model))?;
    sequence.thin(arguments.thinning.stride, arguments.thinning.frames);
    notes(&sequence.remarks);
    let written =
        working("predicting", |step| sigma_images(&sequence, &model, output.path(), step))?;
    output.finish()?;
    notes(&written.remarks);
    let share = written.beyond as f64 / written.measured.max(1) as f64;
    if written.beyond > 0 {
        let [near, far] = model.sigma.domain.z_m;
        say(format!(
            "note: {:.1} % of the pixels lie beyond {near:.2} to {far:.2} m, where sigma was measured: they have its value at the edge",
            1e2 * share
        ));
    }
    if written.clamped > 0 {
        let most = "beyond 0.65 m, the most an image holds";
        say(format!("note: {} pixels have a sigma {most}", written.clamped));
    }
    let (frames, mm, folder) = (written.frames, 1e3 * written.mean_m, arguments.output.display());
    let unit = "10 um a unit";
    let images = counted(frames, "image");
    result(format!("wrote {images} of sigma, {mm:.2} mm on average, {unit}, into {folder}"));
    global.print_json(&json!({
        "frames": written.frames,
        "pixels": written.measured,
        "mean_sigma_m": written.mean_m,
        "clamped": written.clamped,
        "beyond_range": written.beyond,
        "units_per_metre": SIGMA_UNITS_PER_METRE,
        "output": arguments.output,
    }))
}
