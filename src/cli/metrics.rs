use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::io::open;
use kinoise::metrics::{FrameMetrics, Metrics, ViewMetrics, metrics};
use kinoise::report::metrics_page;
use kinoise::units::counted;

use super::common::{Global, Input};
use super::console::{detail_recording, notes, result, say, working};
use super::origin::origin;
use super::output::{METRICS, begin};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise metrics recording
  kinoise metrics recording -o out/metrics --json")]
pub struct Arguments {
    /// A recording, a TUM folder, a fakenect dump, a folder of 16-bit PNGs, a ROS bag (.bag, .mcap, .db3),
    /// or a NumPy stack (.npy, .npz)
    recording: PathBuf,
    /// Folder for metrics.json and report.html
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten, next_help_heading = super::INPUT_HEADING)]
    input: Input,
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let path: &Path = &arguments.recording;
    let output = arguments.output.as_deref();
    let output = output.map(|place| begin(place, METRICS, &[path], global)).transpose()?;
    let recording = open(path, &arguments.input.assumed()?)?;
    detail_recording(&recording);
    let found = working("measuring", |step| metrics(&recording, global.seed(), step))?;
    notes(&recording.remarks);
    notes(&found.remarks);
    notes(found.excluded.iter().map(|[view, why]| format!("view {view} was left out: {why}")));
    report(&found);
    let value = serde_json::to_value(&found)?;
    if let Some(output) = output {
        let place = output.place().to_path_buf();
        output.write("metrics.json", kinoise::io::pretty_json(&value)?.as_bytes())?;
        let title = format!("Depth quality of {}", recording.sensor.name);
        let page = metrics_page(&title, &found, &origin(path, global.seed().0))?;
        output.write("report.html", page.as_bytes())?;
        output.finish()?;
        say(format!("wrote {}", place.join("report.html").display()));
    }
    global.print_json(&value)
}

/// Shown for a missing figure.
const ABSENT: &str = "-";

fn report(found: &Metrics) {
    let width = found.views.iter().map(|v| v.view.chars().count()).max().unwrap_or(4).max(4);
    result(format!(
        "{:width$}  distance m  tilt deg  Z-accuracy %  plane-fit RMS mm  sub-pixel RMS px  temporal %  fill %  kinoise sigma mm",
        "view"
    ));
    found.views.iter().for_each(|view| result(row(view, width)));
    if found.by_distance.len() > 1 {
        result("\nviews that face the sensor within ten degrees (all, where none does)");
        for group in &found.by_distance {
            let ([low, high], views) = (group.range_m, counted(group.views, "view"));
            let [accuracy, rms, subpixel, temporal, fill] =
                figures(&group.mean, group.temporal_noise);
            result(format!(
                "{low:.1} to {high:.1} m, {views}: Z-accuracy {accuracy} %, plane-fit RMS {rms} mm, sub-pixel RMS {subpixel} px, temporal {temporal} %, fill {fill} %"
            ));
        }
    }
    say(
        "note: the RMS is across a plane through all points of a frame, gross errors and bends with them; kinoise's sigma is along the optical axis and robust",
    );
}

fn row(view: &ViewMetrics, width: usize) -> String {
    let ViewMetrics { view: name, mean, temporal_noise, sigma_m, .. } = view;
    let (z, tilt, sigma) = (mean.axis_distance_m, mean.tilt_rad.to_degrees(), 1e3 * sigma_m);
    let [accuracy, rms, subpixel, temporal, fill] = figures(mean, *temporal_noise);
    let errors = format!("{accuracy:>12}  {rms:>16}  {subpixel:>16}  {temporal:>10}  {fill:>6}");
    format!("{name:width$}  {z:>10.3}  {tilt:>8.1}  {errors}  {sigma:>16.2}")
}

/// Z-accuracy in %, RMS in mm and in px, temporal noise and fill rate in %.
fn figures(mean: &FrameMetrics, temporal: Option<f64>) -> [String; 5] {
    [
        optional(mean.z_accuracy.map(|v| 1e2 * v), 2),
        optional(Some(1e3 * mean.plane_fit_rms_m), 2),
        optional(mean.subpixel_rms_px, 3),
        optional(temporal.map(|v| 1e2 * v), 3),
        optional(Some(1e2 * mean.fill_rate), 1),
    ]
}

fn optional(value: Option<f64>, decimals: usize) -> String {
    value.map_or(ABSENT.into(), |v| format!("{v:.decimals$}"))
}
