//! The metrics of depth camera vendors, by the formulas of RealSense's Depth Quality Tool.
//!
//! They differ from what [`crate::measure`] finds on the same pixels. The tool fits its plane to all points
//! of a frame, including gross errors and bent corners. It then leaves out the half percent of nearest and of
//! farthest points, which on a tilted target are its ends and not its errors. Its RMS is perpendicular to the
//! plane and includes everything that bends the depth. Its temporal noise is a share of the depth, and a
//! pixel whose rounded depth never changes counts as noise-free. kinoise's sigma is robust, along the optical
//! axis, and has a standard error.

mod frame;
mod temporal;

pub use frame::FrameMetrics;

use nalgebra::Vector3;
use serde::Serialize;

use crate::Progress;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::measure::{
    MeasureOptions, TargetFrames, ViewMeasurement, Workbench, measure_view, ranges_remark,
    without_copies,
};
use crate::rng::Seed;
use crate::view::{Excluded, Recording, View};
use temporal::TemporalNoise;

/// Metrics of one view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewMetrics {
    pub view: String,
    /// Means over the frames.
    #[serde(flatten)]
    pub mean: FrameMetrics,
    pub reference_distance_m: Option<f64>,
    /// Median over the pixels of a depth's standard deviation over its median; `None` for a single frame.
    pub temporal_noise: Option<f64>,
    /// kinoise's own sigma of the depth, m, and that of one pixel over the frames.
    pub sigma_m: f64,
    pub sigma_temporal_m: Option<f64>,
    pub frames: Vec<FrameMetrics>,
}

/// Views at about one distance, combined; only frontal views if the recording has any.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AtDistance {
    /// Lower and upper end, m.
    pub range_m: [f64; 2],
    pub views: usize,
    /// Means over the views that have the metric.
    #[serde(flatten)]
    pub mean: FrameMetrics,
    pub temporal_noise: Option<f64>,
}

/// Metrics of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Metrics {
    pub views: Vec<ViewMetrics>,
    pub by_distance: Vec<AtDistance>,
    /// Views that cannot be used: name and reason.
    pub excluded: Vec<[String; 2]>,
    /// On frames that were left out, and on the recording.
    pub remarks: Vec<String>,
}

/// Largest tilt of a frontal view; the tool asks for a frontal target, which held by hand is within ten
/// degrees.
const FACED_DEG: f64 = 10.0;
/// Width of the distance groups, m.
const STEP_M: f64 = 0.5;

/// Computes the metrics of every view, each over its target's pixels.
///
/// # Errors
/// If no view can be used; the message gives the first reason.
pub fn metrics(recording: &Recording, seed: Seed, progress: Progress<'_>) -> Result<Metrics> {
    let options = MeasureOptions { seed, ..MeasureOptions::default() };
    let bench = Workbench::new(&recording.sensor, options);
    let (found, mut excluded) = recording.each_view(progress, |view| of_view(view, &bench));
    let (mut views, mut measured): (Vec<ViewMetrics>, Vec<ViewMeasurement>) =
        found.into_iter().unzip();
    excluded.extend(without_copies(recording, &mut measured));
    views.retain(|v| measured.iter().any(|m| m.name == v.view));
    let mut remarks = Vec::from_iter(ranges_remark(recording, &excluded, &bench));
    for view in &measured {
        remarks.extend(view.notes.iter().map(|note| format!("view {}: {note}", view.name)));
    }
    let excluded: Vec<[String; 2]> = excluded.iter().map(named).collect();
    if views.is_empty() {
        let first = excluded
            .first()
            .map_or("there is none".into(), |[view, why]| format!("the first: view {view}: {why}"));
        return Err(Error::recording(
            &recording.root,
            format!("no view can be used; {first}"),
            "put this right, then run again",
        ));
    }
    let by_distance = by_distance(&views);
    Ok(Metrics { views, by_distance, excluded, remarks })
}

fn named(excluded: &Excluded) -> [String; 2] {
    [excluded.view.clone(), excluded.reason.clone()]
}

fn of_view(view: &View, bench: &Workbench<'_>) -> Result<(ViewMetrics, ViewMeasurement)> {
    let (target, shown) = TargetFrames::of(view, bench)?;
    let measured = measure_view(view, bench)?;
    let reference_distance_m = view.notes.reference_distance_m;
    let mut over_time = TemporalNoise::of(target.pixels.len());
    let mut frames = Vec::new();
    // What was measured has a remark on the frames that are left out.
    for (_, frame) in shown {
        let code = &bench.sensor.code;
        let raw = target.pixels.iter().map(|&i| frame.raw[i as usize]);
        over_time.add(raw.map(|raw| code.metres(raw).map(|_| raw)));
        frames.extend(FrameMetrics::of(
            points(&frame, &target.pixels, bench),
            target.pixels.len(),
            bench.sensor.disparity_px_m(),
            reference_distance_m,
        ));
    }
    let mean = FrameMetrics::mean(&frames).ok_or_else(|| Error::View {
        view: view.name.clone(),
        what: "no frame of it shows a plane".into(),
        remedy: "record the view again",
    })?;
    let spread = &measured.whole.spread;
    let metrics = ViewMetrics {
        view: view.name.clone(),
        mean,
        reference_distance_m,
        temporal_noise: over_time.median_share(&bench.sensor.code),
        sigma_m: spread.spatial_m,
        sigma_temporal_m: spread.temporal_m,
        frames,
    };
    Ok((metrics, measured))
}

/// The measured points of the target, m.
fn points(frame: &Frame, pixels: &[u32], bench: &Workbench<'_>) -> Vec<Vector3<f64>> {
    let code = &bench.sensor.code;
    let camera = &bench.sensor.camera;
    let point = |&i: &u32| {
        let i = i as usize;
        let z = code.metres(frame.raw[i])?;
        let (x, y) = camera.ray((i % camera.width) as f64, (i / camera.width) as f64);
        Some(Vector3::new(x * z, y * z, z))
    };
    pixels.iter().filter_map(point).collect()
}

fn by_distance(views: &[ViewMetrics]) -> Vec<AtDistance> {
    let faced = |v: &&ViewMetrics| v.mean.tilt_rad.to_degrees() <= FACED_DEG;
    let any = views.iter().any(|v| faced(&v));
    let views: Vec<&ViewMetrics> = views.iter().filter(|v| !any || faced(v)).collect();
    let step = |v: &ViewMetrics| (v.mean.axis_distance_m / STEP_M).floor();
    let mut steps: Vec<f64> = views.iter().map(|v| step(v)).collect();
    steps.sort_by(f64::total_cmp);
    steps.dedup();
    let group = |at: &f64| {
        let here: Vec<&ViewMetrics> = views.iter().copied().filter(|v| step(v) == *at).collect();
        let means: Vec<FrameMetrics> = here.iter().map(|v| v.mean).collect();
        let noises: Vec<f64> = here.iter().filter_map(|v| v.temporal_noise).collect();
        Some(AtDistance {
            range_m: [at * STEP_M, (at + 1.0) * STEP_M],
            views: here.len(),
            mean: FrameMetrics::mean(&means)?,
            temporal_noise: (!noises.is_empty())
                .then(|| noises.iter().sum::<f64>() / noises.len() as f64),
        })
    };
    steps.iter().filter_map(group).collect()
}
