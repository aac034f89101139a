//! A whole folder written again with the biases taken out of its depth images.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::again::Again;
use super::files::{inside, once, refuse_inside};
use super::words::metric;
use super::{Conditions, Correction};
use crate::Progress;
use crate::error::{Error, Result};
use crate::frame::{DepthCode, DepthTable, FARTHEST_M, Frame};
use crate::io::{Assumed, FrameSource, Layout, open_uncut, refuse_full};
use crate::model::NoiseModel;
use crate::view::{Recording, Sensor, View};

/// What was done to a recording.
#[derive(Debug, Clone)]
pub struct Corrected {
    pub frames: usize,
    /// Pixels with a measurement, in all frames.
    pub measured: usize,
    /// Those whose stored depth is another now.
    pub changed: usize,
    /// Those whose corrected depth lies beyond the ends of the depth code.
    pub clamped: usize,
    /// Root mean square over all measured pixels of what was taken out, m.
    pub rms_shift_m: f64,
    /// How the corrected words become metres.
    pub code: DepthCode,
    /// Entries of the model that were not taken out.
    pub ignored: Vec<String>,
    /// What was odd, in words.
    pub remarks: Vec<String>,
}

/// A depth image to be written again.
pub(super) struct Job {
    /// Relative to the recording.
    pub file: PathBuf,
    pub timestamp: f64,
    pub conditions: Conditions,
}

/// Write the recording at `root` again into `output`, all its files, `model`'s biases taken out of
/// the depth. Raw disparities become metric words, finer than the read-out's steps, unless
/// `keep_code`.
///
/// # Errors
/// When `root` is no recording, the model is of another resolution, or `output` has something in
/// it, lies inside `root`, or cannot be written.
pub fn correct_recording(
    root: &Path,
    assumed: &Assumed,
    model: &NoiseModel,
    output: &Path,
    keep_code: bool,
    progress: Progress<'_>,
) -> Result<Corrected> {
    let layout = Layout::of(root)?;
    refuse_inside(output, root)?;
    refuse_full(output)?;
    let recording = open_uncut(root, assumed)?;
    let correction = Correction::of(model, &recording.sensor)?;
    let jobs = jobs(&recording, root)?;
    let raw = matches!(recording.sensor.code, DepthCode::Disparity { .. });
    let code = if raw && !keep_code && !correction.is_identity() {
        metric(farthest(root, &jobs, &recording.sensor, &correction)?)
    } else {
        recording.sensor.code
    };
    std::fs::create_dir_all(output).map_err(|e| Error::write(output, e))?;
    let again =
        Again { root, output, layout, sensor: &recording.sensor, correction: &correction, code };
    again.write(&jobs, &recording, progress)
}

/// The depth images with what is known of each.
fn jobs(recording: &Recording, root: &Path) -> Result<Vec<Job>> {
    let frames = || recording.views.iter().flat_map(|v| v.depth.iter().map(move |f| (v, f)));
    let begin = frames().map(|(_, f)| f.timestamp).fold(f64::INFINITY, f64::min);
    let conditions = |view: &View, timestamp: f64| Conditions {
        session_s: timestamp - begin,
        temperature_c: view.notes.temperature_c,
        ambient_lux: view.notes.ambient_lux,
    };
    let listed: Result<Vec<_>> = frames()
        .map(|(v, f)| Ok((inside(root, &f.path)?, (f.timestamp, conditions(v, f.timestamp)))))
        .collect();
    let job = |(file, (timestamp, conditions))| Job { file, timestamp, conditions };
    Ok(once(listed?).into_iter().map(job).collect())
}

/// The greatest corrected depth, m.
fn farthest(root: &Path, jobs: &[Job], sensor: &Sensor, correction: &Correction) -> Result<f64> {
    let table = sensor.code.table();
    let of = |job: &Job| -> Result<f64> {
        // What cannot be read is told when it is to be written.
        let Ok(frame) = read(root, job, sensor) else { return Ok(0.0) };
        let mut depth = metres(&frame, &table);
        correction.apply(&mut depth, &job.conditions)?;
        Ok(depth.iter().filter(|z| z.is_finite()).fold(0f32, |a, &b| a.max(b)).into())
    };
    let each: Result<Vec<f64>> = jobs.par_iter().map(of).collect();
    Ok(each?.into_iter().fold(0.0, f64::max).min(FARTHEST_M))
}

pub(super) fn read(root: &Path, job: &Job, sensor: &Sensor) -> Result<Frame> {
    FrameSource::new(sensor.camera.width, sensor.camera.height).read(&root.join(&job.file))
}

/// Depth of every pixel, m; NaN where there is none.
pub(super) fn metres(frame: &Frame, table: &DepthTable) -> Vec<f32> {
    frame.raw.iter().map(|&word| table.metres(word)).collect()
}
