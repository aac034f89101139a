//! The folder as it is written again: image by image, and all that lies beside them.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::Correction;
use super::files::{copy, files_below, make_folder_of, makes_a_recording};
use super::recording::{Corrected, Job, metres, read};
use super::words::Words;
use crate::Progress;
use crate::error::{Error, Result};
use crate::frame::{DepthCode, DepthTable, Frame};
use crate::io::{INDEX, Layout, encode_pgm16, encode_png16, write_atomic};
use crate::view::{Recording, Sensor};

/// The recording on its way into another folder.
pub(super) struct Again<'a> {
    pub root: &'a Path,
    pub output: &'a Path,
    pub layout: Layout,
    pub sensor: &'a Sensor,
    pub correction: &'a Correction,
    pub code: DepthCode,
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
    pub fn write(
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

    pub fn recodes(&self) -> bool {
        self.code != self.sensor.code
    }

    /// Everything but the depth images; of a dump in another code its index too, for it would say
    /// that the words are a Kinect's.
    fn other_files(&self, jobs: &[Job]) -> Result<Vec<PathBuf>> {
        let images: HashSet<&Path> = jobs.iter().map(|j| j.file.as_path()).collect();
        let no_dump = self.recodes() && self.layout == Layout::Dump;
        let mut files = files_below(self.root)?;
        let left_out = |f: &Path| images.contains(f) || (no_dump && f == Path::new(INDEX));
        files.retain(|f| !left_out(f));
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
        let none = self.code.raw(f64::NAN);
        let mut new = frame;
        for (word, (&z, &better)) in new.raw.iter_mut().zip(before.iter().zip(after)) {
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
}

fn is_pgm(file: &Path) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("pgm"))
}
