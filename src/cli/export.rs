use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use kinoise::NoiseModel;
use kinoise::export::{ExportFormat, export};
use kinoise::io::{discard_stale, write_atomic};

use super::common::{Global, one_of};
use super::console::{detail_model, notes, result};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise export out/kinect/model.json --format python -o kinect_noise.py
  kinoise export out/kinect/model.json --format elevation-mapping -o sensor.yaml")]
pub struct Arguments {
    /// model.json, or the folder it is in
    model: PathBuf,
    /// File to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Who is to read it
    #[arg(long, value_name = "FORMAT", value_parser = one_of(FORMATS))]
    format: ExportFormat,
}

const FORMATS: [(&str, &str, ExportFormat); 9] = {
    use ExportFormat::*;
    [
        ("python", "A file that needs numpy alone: sigma(), correct(), sample()", Python),
        ("c", "A C99 header with the same", C),
        ("npz", "Tables of sigma and of the correction for numpy.load", Npz),
        ("opencv", "The same and the intrinsics for cv::FileStorage", OpenCv),
        ("camera-info", "The intrinsics for ROS' camera_info_manager", CameraInfo),
        (
            "elevation-mapping",
            "Parameters of its structured-light sensor processor",
            ElevationMapping,
        ),
        ("isaac", "A depth sensor of Isaac Sim, as a USD layer", Isaac),
        ("clams", "The bias alone, for CLAMS", Clams),
        ("open3d", "The bias alone, for Open3D's DepthNoiseSimulator", Open3d),
    ]
};

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let Arguments { model: file, output, format } = arguments;
    let model = NoiseModel::read(file)?;
    detail_model(&model, Some(file));
    refuse_taken(output, file, global.force)?;
    let exported = export(&model, *format)?;
    output.parent().into_iter().for_each(discard_stale);
    write_atomic(output, &exported.bytes)?;
    notes(&exported.notes);
    result(format!("wrote {}", output.display()));
    global.print_json(&serde_json::json!({
        "format": FORMATS.iter().find(|(.., f)| f == format).map(|(name, ..)| name),
        "output": output,
        "bytes": exported.bytes.len(),
        "notes": exported.notes,
    }))
}

/// Refuses to replace an existing file unless forced, and the model in any case.
fn refuse_taken(output: &Path, model: &Path, force: bool) -> anyhow::Result<()> {
    let Ok(standing) = output.canonicalize() else { return Ok(()) };
    if standing.is_dir() {
        bail!("{}: this is a folder; give the name of a file", output.display());
    }
    let model = if model.is_dir() { model.join("model.json") } else { model.to_path_buf() };
    if model.canonicalize().is_ok_and(|model| model == standing) {
        bail!("{}: the output would replace the model; choose another name", output.display());
    }
    if !force {
        bail!("{}: there is such a file; choose another name, or give --force", output.display());
    }
    Ok(())
}
