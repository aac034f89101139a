//! The figures that vendors of depth cameras give, by the formulas of RealSense's Depth Quality Tool.
//!
//! They differ from what [`crate::measure`] finds on the same pixels. The tool's plane is fitted to all
//! points of a frame, gross errors and bent corners with them; it then leaves out the half percent of
//! nearest and farthest points, which on a tilted target are its ends and not its errors; its root mean
//! square is across the plane, and holds whatever bends the depth; its temporal noise is a share of the
//! depth and counts a rounded pixel that never changes as one without noise. kinoise's sigma is robust,
//! along the optical axis, and with a standard error.

mod frame;
mod temporal;

pub use frame::FrameMetrics;

use nalgebra::Vector3;
use serde::Serialize;

use crate::Progress;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::io::FrameSource;
use crate::measure::{MeasureOptions, ViewMeasurement, Workbench, measure_view, view_target};
use crate::rng::Seed;
use crate::view::{Excluded, Recording, View};
use temporal::TemporalNoise;

/// The figures of one view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewMetrics {
    pub view: String,
    /// Means over the frames.
    #[serde(flatten)]
    pub mean: FrameMetrics,
    pub reference_distance_m: Option<f64>,
    /// Median over the pixels of a depth's standard deviation over its median; of one frame none.
    pub temporal_noise: Option<f64>,
    /// kinoise's own sigma of depth, m, and that of one pixel over the frames.
    pub sigma_m: f64,
    pub sigma_temporal_m: Option<f64>,
    pub frames: Vec<FrameMetrics>,
}

/// Views at about one distance together: those that face the sensor, where there are any.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AtDistance {
    /// From, to; m.
    pub range_m: [f64; 2],
    pub views: usize,
    /// Means over the views that have the figure.
    #[serde(flatten)]
    pub mean: FrameMetrics,
    pub temporal_noise: Option<f64>,
}

/// The figures of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Metrics {
    pub views: Vec<ViewMetrics>,
    pub by_distance: Vec<AtDistance>,
    /// Views that cannot be used: the name, and why.
    pub excluded: Vec<[String; 2]>,
}

/// The tool asks for a target that is faced; by hand that is within ten degrees.
const FACED_DEG: f64 = 10.0;
/// Distances are told by steps of so many metres.
const STEP_M: f64 = 0.5;

/// The figures of every view, each over its target's pixels.
///
/// # Errors
/// When no view can be used; the message gives the first reason.
pub fn metrics(recording: &Recording, seed: Seed, progress: Progress<'_>) -> Result<Metrics> {
    let options = MeasureOptions { seed, ..MeasureOptions::default() };
    let bench = Workbench::new(&recording.sensor, options);
    let (views, excluded) = recording.each_view(progress, |view| of_view(view, &bench));
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
    Ok(Metrics { views, by_distance, excluded })
}

fn named(excluded: &Excluded) -> [String; 2] {
    [excluded.view.clone(), excluded.reason.clone()]
}

fn of_view(view: &View, bench: &Workbench<'_>) -> Result<ViewMetrics> {
    let target = view_target(view, bench)?;
    let ViewMeasurement { whole, .. } = measure_view(view, bench)?;
    let camera = &bench.sensor.camera;
    let mut source = FrameSource::new(camera.width, camera.height);
    let reference_distance_m = view.notes.reference_distance_m;
    let mut over_time = TemporalNoise::of(target.pixels.len());
    let mut frames = Vec::new();
    for stored in &view.depth {
        // What cannot be read is a note of the calibration, and no frame here.
        let Ok(frame) = source.frame(stored) else { continue };
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
    Ok(ViewMetrics {
        view: view.name.clone(),
        mean,
        reference_distance_m,
        temporal_noise: over_time.median_share(&bench.sensor.code),
        sigma_m: whole.spread.spatial_m,
        sigma_temporal_m: whole.spread.temporal_m,
        frames,
    })
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
