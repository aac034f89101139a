//! From one view's frames to its plane and its sigma, cell by cell.
//!
//! Frames are read once, in order, and only a handful are held: the first few find the target
//! and the scale, the rest stream through accumulators.

mod cells;
mod doubtful;
mod grouping;
mod lagged;
mod paper;
mod reference;
mod scan;
mod table;

pub use cells::{Cell, Spread};
pub use paper::PaperResult;
pub use reference::ReferenceDistance;
pub use table::{
    MEASUREMENT_COLUMNS, SigmaKind, SigmaRow, SigmaTable, read_table, write_measurements,
};

use crate::camera::Rays;
use crate::error::{Error, Result};
use crate::frame::{DepthTable, Frame};
use crate::io::{FrameSource, InfraredImage};
use crate::plane::{Exclusions, InverseDepthImage, Plane, Target, find_target};
use crate::rng::Seed;
use crate::stats::Correlation;
use crate::view::{FrameRef, Sensor, View};

use scan::Scan;

/// One plane for the still view, or a fresh one for every frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Planes {
    /// Right for a still scene: the errors that all frames share stay in sigma.
    #[default]
    PerView,
    /// For a target that trembles: sigma no longer holds what moves as a whole.
    PerFrame,
}

/// Settings of the measurement.
#[derive(Debug, Clone, Copy)]
pub struct MeasureOptions {
    /// One plane a view, or one a frame.
    pub planes: Planes,
    /// The paper's RANSAC threshold, m; by default three robust standard deviations of the view.
    pub ransac_threshold_m: Option<f64>,
    /// Most hypotheses the paper's RANSAC tries.
    pub ransac_iterations: usize,
    /// Of all random choices.
    pub seed: Seed,
}

impl Default for MeasureOptions {
    fn default() -> Self {
        MeasureOptions {
            planes: Planes::default(),
            ransac_threshold_m: None,
            ransac_iterations: 500,
            seed: Seed(0),
        }
    }
}

/// What every view of a recording shares: computed once.
#[derive(Debug)]
pub struct Workbench<'a> {
    /// The unit that recorded.
    pub sensor: &'a Sensor,
    /// Of all its pixels.
    pub rays: Rays,
    /// From word to m.
    pub table: DepthTable,
    /// The settings.
    pub options: MeasureOptions,
    /// The words hold the length of the ray, not the depth.
    pub ranges: bool,
}

impl<'a> Workbench<'a> {
    /// Works out the rays of all pixels and the depth of all words.
    pub fn new(sensor: &'a Sensor, options: MeasureOptions) -> Self {
        Workbench {
            sensor,
            rays: sensor.camera.rays(),
            table: sensor.code.table(),
            options,
            ranges: false,
        }
    }

    /// Step of the depth code at inverse depth `w`, 1/m.
    fn step(&self, w: f64) -> f64 {
        if w > 0.0 { self.sensor.code.step_inverse(1.0 / w) } else { 0.0 }
    }
}

/// All that one view tells.
#[derive(Debug, Clone)]
pub struct ViewMeasurement {
    /// The view's name.
    pub name: String,
    /// Seconds on the recording's clock, first frame.
    pub time_s: f64,
    /// The default plane fit.
    pub plane: Plane,
    /// Mean depth of the target's pixels, m.
    pub z_m: f64,
    /// Between the optical axis and the plane's normal, rad.
    pub theta_rad: f64,
    /// Image direction in which depth grows, rad; 0 along the columns.
    pub azimuth_rad: f64,
    /// The whole target as one.
    pub whole: Cell,
    /// The target cut into bins of depth; one bin when it is not strongly tilted.
    pub cells: Vec<Cell>,
    /// The paper's method on the first frame.
    pub paper: Option<PaperResult>,
    /// Between neighbouring pixels' residuals.
    pub correlation: Correlation,
    /// Correlation of a pixel with itself one frame later; `None` with fewer than 4 frames.
    pub temporal_correlation: Option<f64>,
    /// Frames used.
    pub frames: usize,
    /// Pixels left out, by reason.
    pub exclusions: Exclusions,
    /// From `view.json`, m.
    pub reference_distance_m: Option<f64>,
    /// Depth of the plane on the optical axis, m: what a reference distance is compared with.
    pub axis_distance_m: f64,
    /// Mean infrared amplitude of the target, in the image's own units.
    pub infrared: Option<f64>,
    /// Of the mean residual.
    pub picture: ResidualPicture,
    /// What was odd about it, in words.
    pub notes: Vec<String>,
    /// SHA-256 of the frames' bytes in order.
    pub digest: [u8; 32],
}

impl ViewMeasurement {
    /// The distance on the optical axis beside the one that `view.json` gives, if it gives one.
    pub fn reference(&self) -> Option<ReferenceDistance> {
        self.reference_distance_m
            .map(|reference_m| ReferenceDistance { reference_m, measured_m: self.axis_distance_m })
    }
}

/// The view's mean residual, shrunk for looking at; NaN outside the target.
#[derive(Debug, Clone)]
pub struct ResidualPicture {
    /// Columns, px of the picture.
    pub width: usize,
    /// Rows, px of the picture.
    pub height: usize,
    /// Axial residual, mm, row-major.
    pub millimetres: Vec<f32>,
}

/// Frames held while the target and the scale are found; more would not make them surer.
const HELD_FRAMES: usize = 8;

/// Measure one view.
///
/// # Errors
/// When no frame can be read or none shows a plane; unreadable frames beside good ones are told
/// in the notes.
pub fn measure_view(view: &View, bench: &Workbench<'_>) -> Result<ViewMeasurement> {
    let camera = &bench.sensor.camera;
    let mut source = FrameSource::new(camera.width, camera.height);
    let mut reader = FrameReader::of(view, &mut source, &bench.table);
    let held = reader.hold(view)?;
    let target = target_of(view, bench, &held)?;
    let mut scan = Scan::begin(bench, &target, &held);
    for frame in &held {
        scan.add(frame);
    }
    while let Some(frame) = reader.next_readable() {
        scan.add(&frame);
    }
    let mut notes = reader.notes;
    let paper = paper::measure(view, bench, &target, &held[0], scan.sigma_perpendicular());
    let infrared = infrared_of(view, &target, bench, &mut notes);
    notes.extend(target.notes.iter().cloned());
    let mut result = scan.finish(&target, &held[0]).ok_or_else(|| {
        failed(
            view,
            "the residuals of its plane cannot be measured".into(),
            "record the view again",
        )
    })?;
    result.name = view.name.clone();
    result.time_s = view.depth[0].timestamp;
    result.paper = paper;
    result.infrared = infrared;
    result.reference_distance_m = view.notes.reference_distance_m;
    notes.append(&mut result.notes);
    result.notes = notes;
    result.digest = source.digest();
    Ok(result)
}

/// The target of one view, from its first frames.
///
/// # Errors
/// As [`measure_view`].
pub fn view_target(view: &View, bench: &Workbench<'_>) -> Result<Target> {
    let camera = &bench.sensor.camera;
    let mut source = FrameSource::new(camera.width, camera.height);
    let mut reader = FrameReader::of(view, &mut source, &bench.table);
    let held = reader.hold(view)?;
    target_of(view, bench, &held)
}

/// Hands out the frames that can be read; tells of the others.
struct FrameReader<'r> {
    frames: std::slice::Iter<'r, FrameRef>,
    source: &'r mut FrameSource,
    notes: Vec<String>,
    table: &'r DepthTable,
}

fn failed(view: &View, what: String, remedy: &'static str) -> Error {
    Error::View { view: view.name.clone(), what, remedy }
}

impl<'r> FrameReader<'r> {
    fn of(view: &'r View, source: &'r mut FrameSource, table: &'r DepthTable) -> Self {
        FrameReader { frames: view.depth.iter(), source, notes: Vec::new(), table }
    }

    /// The first readable frames.
    fn hold(&mut self, view: &View) -> Result<Vec<Frame>> {
        let mut held = Vec::new();
        while held.len() < HELD_FRAMES {
            let Some(frame) = self.next_readable() else { break };
            held.push(frame);
        }
        if held.is_empty() {
            let why = self.notes.first().cloned().unwrap_or_else(|| "it has no frame".into());
            return Err(failed(view, why, "record the view again"));
        }
        Ok(held)
    }

    fn next_readable(&mut self) -> Option<Frame> {
        while let Some(frame_ref) = self.frames.next() {
            match self.source.read(&frame_ref.path) {
                Ok(frame) if self.sees_anything(&frame) => return Some(frame),
                Ok(_) => self.notes.push(format!(
                    "frame left out: {}: no pixel carries a depth",
                    frame_ref.path.display()
                )),
                Err(e) => self.notes.push(format!("frame left out: {e}")),
            }
        }
        None
    }

    fn sees_anything(&self, frame: &Frame) -> bool {
        frame.raw.iter().any(|&word| self.table.metres(word).is_finite())
    }
}

fn target_of(view: &View, bench: &Workbench<'_>, held: &[Frame]) -> Result<Target> {
    let mut w = mean_inverse_depth(held, &bench.table);
    if bench.ranges {
        for (i, w) in w.iter_mut().enumerate() {
            let (x, y) = bench.rays.at(i);
            *w *= (1.0 + x * x + y * y).sqrt() as f32;
        }
    }
    let image = InverseDepthImage {
        w: &w,
        rays: &bench.rays,
        camera: &bench.sensor.camera,
        step: &|w| bench.step(w),
    };
    let mut rng = bench.options.seed.stream(&format!("target/{}", view.name));
    find_target(&image, view.notes.region.as_ref(), &mut rng).map_err(|what| {
        failed(
            view,
            what,
            "give the target's region in view.json (roi or polygon), or record the view again",
        )
    })
}

/// Mean over the frames, where at least half of them measured; 1/m, NaN elsewhere.
fn mean_inverse_depth(frames: &[Frame], table: &DepthTable) -> Vec<f32> {
    let n = frames[0].raw.len();
    let mut sum = vec![0f32; n];
    let mut count = vec![0u8; n];
    for frame in frames {
        for ((s, c), &word) in sum.iter_mut().zip(&mut count).zip(&frame.raw) {
            let z = table.metres(word);
            if z.is_finite() {
                *s += 1.0 / z;
                *c += 1;
            }
        }
    }
    sum.iter()
        .zip(&count)
        .map(
            |(s, &c)| {
                if 2 * usize::from(c) >= frames.len() && c > 0 {
                    s / f32::from(c)
                } else {
                    f32::NAN
                }
            },
        )
        .collect()
}

/// Mean amplitude over the target in the view's first readable infrared image.
fn infrared_of(
    view: &View,
    target: &Target,
    bench: &Workbench<'_>,
    notes: &mut Vec<String>,
) -> Option<f64> {
    for frame in &view.infrared {
        match InfraredImage::read(&frame.path) {
            Ok(image) if image.amplitude.len() == bench.sensor.camera.pixels() => {
                let sum: f64 =
                    target.pixels.iter().map(|&i| f64::from(image.amplitude[i as usize])).sum();
                return Some(sum / target.pixels.len() as f64);
            }
            Ok(image) => notes.push(format!(
                "infrared left out: {} is {} x {} px, the depth {} x {}",
                frame.path.display(),
                image.width,
                image.height,
                bench.sensor.camera.width,
                bench.sensor.camera.height
            )),
            Err(e) => notes.push(format!("infrared left out: {e}")),
        }
    }
    None
}
