//! A recording: a sensor and the views it took of a planar target.

mod description;
mod intrinsics;
mod notes;

pub use description::{RECORDING_FORMAT, RecordingFile};
pub use intrinsics::IntrinsicsUncertainty;
pub use notes::{Region, TargetSize, ViewNotes};

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::Progress;
use crate::camera::Camera;
use crate::error::Result;
use crate::frame::{DepthCode, Frame};
use crate::sensors::{KINECT_BASELINE_M, SensorKind};
use crate::units::shortest;

/// Accepted baselines, m: from half that of the smallest structured-light module (1 cm) to twice that of
/// the longest stereo rig on a car's roof (1.5 m).
pub const BASELINE_M: [f64; 2] = [0.005, 3.0];
/// Limit of the depth at which the disparity equals the image width, m. Stereo cameras on cars see from
/// 2 to 3 m on.
const MAX_NEAREST_M: f64 = 10.0;

/// Longest name, characters; the longest of vendors have fifty.
const MAX_NAME: usize = 200;

/// The unit that was recorded: everything `recording.json` says about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    pub name: String,
    pub serial: Option<String>,
    /// "normal" or "near".
    pub mode: Option<String>,
    pub camera: Camera,
    /// Distance between projector and camera, m.
    pub baseline_m: Option<f64>,
    pub code: DepthCode,
    /// How well the intrinsics are known, where the recording says so.
    pub intrinsics_uncertainty: Option<IntrinsicsUncertainty>,
    /// How it measures depth, where that is known.
    pub kind: Option<SensorKind>,
}

impl Sensor {
    /// fx * baseline, px m: the disparity in px is this over the depth in m.
    pub fn disparity_px_m(&self) -> Option<f64> {
        self.baseline_m.filter(|_| self.may_have_disparity()).map(|b| self.camera.fx * b)
    }

    /// Same, with a Kinect's baseline where there is none.
    pub fn scale_px_m(&self) -> f64 {
        self.disparity_px_m().unwrap_or(self.camera.fx * KINECT_BASELINE_M)
    }

    /// Whether its pictures are a Kinect v1's by kind and width.
    pub fn may_be_kinect(&self) -> bool {
        let light = self.kind.is_none_or(|kind| kind == SensorKind::StructuredLight);
        light && self.camera.width == 640
    }

    /// Whether it is not known to be a time-of-flight camera.
    pub fn may_have_disparity(&self) -> bool {
        self.kind.is_none_or(SensorKind::has_disparity)
    }

    /// What is wrong with these numbers, if anything.
    pub fn fault(&self) -> Option<String> {
        let camera = self.camera.fault();
        let uncertainty = || self.intrinsics_uncertainty?.fault(&self.camera);
        let numbers = camera.or_else(|| self.code.fault()).or_else(|| self.baseline_fault());
        numbers.or_else(uncertainty).or_else(|| self.name_fault())
    }

    /// Checks the names, which appear in every result, each on one line.
    fn name_fault(&self) -> Option<String> {
        let (serial, mode) = (self.serial.as_deref(), self.mode.as_deref());
        let names = [("sensor", Some(&*self.name)), ("serial", serial), ("mode", mode)];
        names.into_iter().find_map(|(key, name)| {
            let name = name?;
            let count = name.chars().count();
            if count > MAX_NAME {
                return Some(format!("{key} has {count} characters, a name up to {MAX_NAME}"));
            }
            let control = name.chars().find(|c| c.is_control())?;
            Some(format!("{key} has the control character {control:?} in it"))
        })
    }

    fn baseline_fault(&self) -> Option<String> {
        let baseline_m = self.baseline_m?;
        let shown = shortest(baseline_m);
        let [low, high] = BASELINE_M;
        if !(low..=high).contains(&baseline_m) {
            return Some(format!("baseline_m = {shown} is not from {low} to {high} m"));
        }
        let Camera { fx, width, .. } = self.camera;
        let nearest_m = fx * baseline_m / width as f64;
        (nearest_m > MAX_NEAREST_M).then(|| {
            format!(
                "baseline_m = {shown} and fx = {} px: up to {nearest_m:.0} m away the disparity exceeds the image's width",
                shortest(fx)
            )
        })
    }
}

/// A frame that is read on demand.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameRef {
    /// Seconds, one clock for the whole recording.
    pub timestamp: f64,
    /// The image, or the file that holds it among others.
    pub path: PathBuf,
    /// Which of the frames in `path`; `None` where the file is one image.
    pub within: Option<Within>,
}

impl FrameRef {
    /// A frame in an image file of its own.
    pub fn file(timestamp: f64, path: PathBuf) -> Self {
        FrameRef { timestamp, path, within: None }
    }

    /// Human-readable location.
    pub fn place(&self) -> String {
        let file = self.path.display();
        match &self.within {
            None => file.to_string(),
            Some(Within { store, index }) => format!("{file}: {}", store.place(*index)),
        }
    }
}

/// A frame of a file that holds many.
#[derive(Debug, Clone)]
pub struct Within {
    pub store: Arc<dyn FrameStore>,
    pub index: usize,
}

impl PartialEq for Within {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.store, &other.store) && self.index == other.index
    }
}

/// A file that holds many depth frames. Reads them on demand, from any thread, and keeps only a few in
/// memory.
pub trait FrameStore: std::fmt::Debug + Send + Sync {
    /// Reads a frame. Fails, naming the place, when it is damaged.
    fn frame(&self, index: usize) -> Result<Frame>;
    /// Location of a frame in the file: its topic and number.
    fn place(&self, index: usize) -> String;
}

/// One still pose of target and sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Name of the folder, or of the file or stretch where a view has no folder.
    pub name: String,
    /// Depth frames in time order.
    pub depth: Vec<FrameRef>,
    /// Infrared images in time order; may be none.
    pub infrared: Vec<FrameRef>,
    pub notes: ViewNotes,
}

/// A sensor and its views in name order, with frames not yet read.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The folder it was opened from.
    pub root: PathBuf,
    pub sensor: Sensor,
    /// The views that could be opened.
    pub views: Vec<View>,
    pub excluded: Vec<Excluded>,
    /// Oddities found while opening.
    pub remarks: Vec<String>,
    /// Whether its frames are captures, each a view of its own, and no film.
    pub captures: bool,
    /// Files that describe the recording (not the frames), for provenance.
    pub described_by: Vec<PathBuf>,
}

impl Recording {
    /// Time of the first depth frame of any view, s: where the session's clock begins.
    pub fn start_s(&self) -> f64 {
        let frames = self.views.iter().flat_map(|v| &v.depth);
        frames.map(|f| f.timestamp).fold(f64::INFINITY, f64::min)
    }

    /// Applies `of` to all views in parallel. Returns the results in order, and the excluded views: those
    /// excluded before, then those for which `of` failed. `progress` counts views.
    pub fn each_view<'a, T: Send>(
        &'a self,
        progress: Progress<'_>,
        of: impl Fn(&'a View) -> Result<T> + Sync,
    ) -> (Vec<T>, Vec<Excluded>) {
        let (done, total) = (AtomicUsize::new(0), self.views.len());
        let counted = |view| {
            let result = of(view);
            progress.step(done.fetch_add(1, Ordering::Relaxed) + 1, total);
            result
        };
        let results: Vec<Result<T>> = self.views.par_iter().map(counted).collect();
        let (mut made, mut excluded) = (Vec::new(), self.excluded.clone());
        for (view, result) in self.views.iter().zip(results) {
            match result {
                Ok(one) => made.push(one),
                Err(e) => excluded.push(Excluded::of(&view.name, &e)),
            }
        }
        (made, excluded)
    }
}

/// A view that was not used, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Excluded {
    pub view: String,
    /// What went wrong, where, and what to do.
    pub reason: String,
}

impl Excluded {
    pub(crate) fn of(view: &str, error: &crate::error::Error) -> Self {
        let text = error.to_string();
        // The view name has its own field.
        let reason = text.strip_prefix(&format!("view {view}: ")).unwrap_or(&text);
        Excluded { view: view.into(), reason: reason.into() }
    }
}

/// Removes views that are the `same` as an earlier one. Returns each copy, with its original's index among
/// the views kept.
pub(crate) fn take_out_copies<T>(
    views: &mut Vec<T>,
    same: impl Fn(&T, &T) -> bool,
) -> Vec<(T, usize)> {
    let (mut kept, mut copies): (Vec<T>, Vec<(T, usize)>) = (Vec::new(), Vec::new());
    for view in views.drain(..) {
        match kept.iter().position(|k| same(k, &view)) {
            Some(first) => copies.push((view, first)),
            None => kept.push(view),
        }
    }
    *views = kept;
    copies
}

impl std::fmt::Display for Excluded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "view {} was left out: {}", self.view, self.reason)
    }
}
