//! A whole folder written again with the biases taken out of its depth images.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde_json::{Value, json};

use super::files::{
    copy, files_below, inside, make_folder_of, makes_a_recording, once, refuse_inside,
};
use super::words::{Words, metric};
use super::{Conditions, Correction};
use crate::calibrate::Progress;
use crate::error::{Error, Result};
use crate::frame::{DepthCode, DepthTable, FARTHEST_M, Frame};
use crate::io::{
    Assumed, DESCRIPTION, FrameSource, INDEX, Layout, encode_pgm16, encode_png16, open_uncut,
    refuse_full, write_atomic, write_recording_file,
};
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
struct Job {
    /// Relative to the recording.
    file: PathBuf,
    timestamp: f64,
    conditions: Conditions,
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

fn read(root: &Path, job: &Job, sensor: &Sensor) -> Result<Frame> {
    FrameSource::new(sensor.camera.width, sensor.camera.height).read(&root.join(&job.file))
}

fn metres(frame: &Frame, table: &DepthTable) -> Vec<f32> {
    frame.words.iter().map(|&word| table.metres(word)).collect()
}

/// The recording on its way into another folder.
struct Again<'a> {
    root: &'a Path,
    output: &'a Path,
    layout: Layout,
    sensor: &'a Sensor,
    correction: &'a Correction,
    code: DepthCode,
}

/// What was done to one image, or why it could not be read.
#[derive(Default)]
struct Tally {
    measured: usize,
    changed: usize,
    clamped: usize,
    square_m2: f64,
    unread: Option<String>,
}

impl Again<'_> {
    fn write(
        &self,
        jobs: &[Job],
        recording: &Recording,
        progress: Progress<'_>,
    ) -> Result<Corrected> {
        let others = self.other_files(jobs)?;
        let (last, first): (Vec<&PathBuf>, Vec<&PathBuf>) =
            others.iter().partition(|f| makes_a_recording(f));
        copy(self.root, self.output, &first)?;
        let (table, words) = (self.sensor.code.table(), Words::of(self.code));
        let done = AtomicUsize::new(0);
        let each = |job: &Job| {
            let tally = self.image(job, &table, &words);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, jobs.len());
            tally
        };
        let tallies: Result<Vec<Tally>> = jobs.par_iter().map(each).collect();
        let corrected = self.sum(&tallies?, recording)?;
        copy(self.root, self.output, &last)?;
        if self.recodes() {
            self.describe(jobs)?;
        }
        Ok(corrected)
    }

    fn recodes(&self) -> bool {
        self.code != self.sensor.code
    }

    /// Everything but the depth images; of a dump in another code its index too, for it would say
    /// that the words are a Kinect's.
    fn other_files(&self, jobs: &[Job]) -> Result<Vec<PathBuf>> {
        let images: std::collections::HashSet<&Path> =
            jobs.iter().map(|j| j.file.as_path()).collect();
        let no_dump = self.recodes() && self.layout == Layout::Dump;
        let mut files = files_below(self.root)?;
        files.retain(|f| !images.contains(f.as_path()) && !(no_dump && f == Path::new(INDEX)));
        Ok(files)
    }

    fn image(&self, job: &Job, table: &DepthTable, words: &Words) -> Result<Tally> {
        let target = self.target(job);
        make_folder_of(&target)?;
        let source = self.root.join(&job.file);
        let frame = match read(self.root, job, self.sensor) {
            Ok(frame) => frame,
            Err(why) => {
                let bytes = std::fs::read(&source).map_err(|e| Error::read(&source, e))?;
                write_atomic(&target, &bytes)?;
                return Ok(Tally { unread: Some(why.to_string()), ..Tally::default() });
            }
        };
        let before = metres(&frame, table);
        let mut after = before.clone();
        self.correction.apply(&mut after, &job.conditions)?;
        let (new, tally) = self.recode(frame, &before, &after, words);
        let bytes = if tally.changed == 0 && !self.recodes() {
            std::fs::read(&source).map_err(|e| Error::read(&source, e))?
        } else if is_pgm(&target) {
            encode_pgm16(&new)
        } else {
            encode_png16(&new)?
        };
        write_atomic(&target, &bytes)?;
        Ok(tally)
    }

    /// Corrected depths as words; what was no measurement stays none.
    fn recode(&self, frame: Frame, before: &[f32], after: &[f32], words: &Words) -> (Frame, Tally) {
        let mut tally = Tally::default();
        let none = self.code.word(f64::NAN);
        let mut new = frame;
        for (word, (&z, &better)) in new.words.iter_mut().zip(before.iter().zip(after)) {
            let old = *word;
            if z.is_nan() {
                *word = if self.recodes() { none } else { old };
                continue;
            }
            tally.measured += 1;
            if z == better && !self.recodes() {
                continue;
            }
            let (nearest, clamped) = words.nearest(better);
            *word = nearest;
            tally.clamped += usize::from(clamped);
            tally.changed += usize::from(if self.recodes() { better != z } else { nearest != old });
            // Where no depth is left, the end of the code is what was done.
            let stored = if better.is_finite() { f64::from(better) } else { words.farthest_m() };
            tally.square_m2 += (stored - f64::from(z)).powi(2);
        }
        (new, tally)
    }

    /// Dumps in another code go on as a described sequence, whose images are PNGs.
    fn target(&self, job: &Job) -> PathBuf {
        let target = self.output.join(&job.file);
        if self.recodes() && is_pgm(&target) { target.with_extension("png") } else { target }
    }

    fn sum(&self, tallies: &[Tally], recording: &Recording) -> Result<Corrected> {
        let unread: Vec<&String> = tallies.iter().filter_map(|t| t.unread.as_ref()).collect();
        if let (Some(first), true) = (unread.first(), unread.len() == tallies.len()) {
            let what = format!("no depth image can be read; the first: {first}");
            return Err(Error::recording(self.root, what, "record it again"));
        }
        let total = |of: fn(&Tally) -> usize| tallies.iter().map(of).sum::<usize>();
        let measured = total(|t| t.measured);
        // In the order of the frames, whichever thread was first.
        let square: f64 = tallies.iter().map(|t| t.square_m2).sum();
        let mut remarks = recording.remarks.clone();
        remarks.extend(self.correction.remarks().iter().cloned());
        let left_out = recording.excluded.iter();
        remarks
            .extend(left_out.map(|e| format!("view {} is copied as it is: {}", e.view, e.reason)));
        remarks.extend(unread.iter().map(|why| format!("copied as it is: {why}")));
        remarks.extend(self.undescribed());
        Ok(Corrected {
            frames: tallies.len() - unread.len(),
            measured,
            changed: total(|t| t.changed),
            clamped: total(|t| t.clamped),
            rms_shift_m: (square / measured.max(1) as f64).sqrt(),
            code: self.code,
            ignored: self.correction.ignored().to_vec(),
            remarks,
        })
    }

    /// A folder of mere images cannot say that its words mean something else now.
    fn undescribed(&self) -> Option<String> {
        let DepthCode::Metric { units_per_metre, .. } = self.code else { return None };
        (self.recodes() && self.layout == Layout::Images).then(|| {
            format!("read the corrected folder with --units-per-metre {units_per_metre}, not --raw-disparity")
        })
    }

    /// Say in recording.json what the words mean now; what else it says stays.
    fn describe(&self, jobs: &[Job]) -> Result<()> {
        let sensor = Sensor { code: self.code, ..self.sensor.clone() };
        match self.layout {
            Layout::Images => Ok(()),
            Layout::Dump => {
                self.list(jobs)?;
                write_recording_file(self.output, &sensor)
            }
            Layout::Recording | Layout::Sequence => {
                let path = self.output.join(DESCRIPTION);
                match std::fs::read_to_string(&path) {
                    Ok(text) => write_atomic(&path, with_code(&text, &self.code)?.as_bytes()),
                    Err(_) => write_recording_file(self.output, &sensor),
                }
            }
        }
    }

    fn list(&self, jobs: &[Job]) -> Result<()> {
        let mut list = String::from("# timestamp path\n");
        for job in jobs {
            let _ =
                writeln!(list, "{:.6} {}", job.timestamp, job.file.with_extension("png").display());
        }
        write_atomic(&self.output.join("depth.txt"), list.as_bytes())
    }
}

fn is_pgm(file: &Path) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("pgm"))
}

/// The text of recording.json with another code.
fn with_code(text: &str, code: &DepthCode) -> Result<String> {
    let failed = |e: serde_json::Error| Error::Argument {
        what: format!("{DESCRIPTION}: {e}"),
        remedy: "compare it with the recording layout in the README",
    };
    let mut value: Value = serde_json::from_str(text).map_err(failed)?;
    if let (Some(map), DepthCode::Metric { units_per_metre, invalid }) =
        (value.as_object_mut(), code)
    {
        map.shift_remove("raw_disparity");
        map.insert("units_per_metre".into(), json!(units_per_metre));
        map.insert("invalid".into(), json!(invalid));
    }
    let mut text = serde_json::to_string_pretty(&value).map_err(failed)?;
    text.push('\n');
    Ok(text)
}
