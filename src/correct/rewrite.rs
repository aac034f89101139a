//! Copies the files of a recording into another folder, with corrected depth images.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::correction::{Conditions, Correction};
use super::describe::describe;
use super::files::{copy, files_below, inside, make_folder_of, makes_a_recording};
use super::raw::RawCode;
use crate::Progress;
use crate::error::{Error, Result};
use crate::frame::{DepthCode, DepthTable, FARTHEST_M, Frame};
use crate::io::{
    DESCRIPTION, INDEX, Layout, encode_corrected, encode_pgm16, encode_png16, read_depth,
    read_list, write_atomic,
};
use crate::read::read_image;
use crate::units::counted;
use crate::view::{FrameRef, Recording, Sensor};

/// Result of correcting a recording.
#[derive(Debug, Clone)]
pub struct Corrected {
    pub frames: usize,
    /// Pixels with a measurement, in all frames.
    pub measured: usize,
    /// Pixels whose stored depth changed.
    pub changed: usize,
    /// Pixels whose corrected depth lies beyond the ends of the depth code.
    pub clamped: usize,
    /// Pixels at disparities outside the model's learnt range, where the correction is held at the edge.
    pub beyond: usize,
    /// RMS of the correction over all measured pixels, m.
    pub rms_shift_m: f64,
    /// Depth code of the corrected raw values.
    pub code: DepthCode,
    /// Entries of the model that were not corrected.
    pub ignored: Vec<String>,
    /// Remarks on anything unusual.
    pub remarks: Vec<String>,
}

/// A depth image to be rewritten.
pub(super) struct Image {
    /// Path relative to the corrected recording; that of the source if it is a file of its own.
    pub file: PathBuf,
    pub source: FrameRef,
    conditions: Conditions,
}

/// The depth images with their conditions, each once even if several lists name it.
pub(super) fn images(recording: &Recording, root: &Path) -> Result<Vec<Image>> {
    let frames = || recording.views.iter().flat_map(|v| v.depth.iter().map(move |f| (v, f)));
    let begin = recording.start_s();
    let (mut known, mut images) = (HashSet::new(), Vec::new());
    for (view, frame) in frames() {
        let file = match &frame.within {
            Some(within) if recording.captures => format!("{:06}.png", within.index).into(),
            Some(within) => format!("depth/{:06}.png", within.index).into(),
            None => inside(root, &frame.path)?,
        };
        let conditions = Conditions {
            session_s: frame.timestamp - begin,
            temperature_c: view.notes.temperature_c,
            ambient_lux: view.notes.ambient_lux,
        };
        if known.insert(file.clone()) {
            images.push(Image { file, source: frame.clone(), conditions });
        }
    }
    refuse_others_outside(recording, root)?;
    Ok(images)
}

/// Fails if an infrared or colour image lies outside `root`: the copied lists would name a missing file.
fn refuse_others_outside(recording: &Recording, root: &Path) -> Result<()> {
    let colour = root.join("rgb.txt");
    let colour = if colour.is_file() { read_list(&colour).ok() } else { None };
    let colour = colour.iter().flat_map(|list| &list.frames);
    let infrared = recording.views.iter().flat_map(|v| &v.infrared);
    let mut files = infrared.chain(colour).filter(|f| f.within.is_none());
    files.try_for_each(|frame| inside(root, &frame.path).map(drop))
}

/// The rewriting of a recording into another folder.
pub(super) struct Rewrite<'a> {
    pub root: &'a Path,
    pub output: &'a Path,
    pub layout: Layout,
    pub sensor: &'a Sensor,
    pub correction: Correction,
    pub table: DepthTable,
    /// The depth code to write.
    pub raw: RawCode,
    /// Folder for images of the uncertainty.
    pub sigma: Option<&'a Path>,
}

/// Units of 10 um: 16 bits hold 0.65 m.
pub const SIGMA_UNITS_PER_METRE: f64 = 1e5;

/// The largest value of an image.
pub(super) const TOP: f64 = 65535.0;

/// The value of a pixel. A measured pixel never gets the value for no depth.
pub(super) fn sigma_word(sigma_m: f64) -> u16 {
    if sigma_m.is_nan() {
        0
    } else {
        (sigma_m * SIGMA_UNITS_PER_METRE).round().clamp(1.0, TOP) as u16
    }
}

pub(super) const SIGMA_FORMAT: &str = "kinoise-correction-sigma/1";

/// Whether the folder holds uncertainties of an earlier correction.
pub fn is_uncertainty(folder: &Path) -> bool {
    std::fs::read_to_string(folder.join("sigma.json")).is_ok_and(|s| s.contains(SIGMA_FORMAT))
}

/// Statistics of one image, or why it could not be read.
#[derive(Default)]
struct Tally {
    measured: usize,
    changed: usize,
    clamped: usize,
    beyond: usize,
    square_m2: f64,
    unread: Option<String>,
}

impl Rewrite<'_> {
    pub fn write(
        &self,
        images: &[Image],
        recording: &Recording,
        progress: Progress<'_>,
    ) -> Result<Corrected> {
        let others = self.other_files(images, recording)?;
        let (last, first): (Vec<&PathBuf>, Vec<&PathBuf>) =
            others.iter().partition(|f| makes_a_recording(f));
        copy(self.root, self.output, &first)?;
        let done = AtomicUsize::new(0);
        let each = |image: &Image| {
            let tally = self.image(image);
            progress.step(done.fetch_add(1, Ordering::Relaxed) + 1, images.len());
            tally
        };
        // The first error in frame order, not the first that a thread meets.
        let tallies: Vec<Result<Tally>> = images.par_iter().map(each).collect();
        let tallies = tallies.into_iter().collect::<Result<Vec<_>>>()?;
        let mut corrected = self.sum(&tallies, recording)?;
        let cold = images.iter().filter(|i| i.conditions.temperature_c.is_none()).count();
        if cold > 0 {
            let place = format!("{cold} of {}", counted(images.len(), "frame"));
            corrected.remarks.extend(self.correction.remark_without_temperature(&place));
        }
        copy(self.root, self.output, &last)?;
        // A dump that keeps its code remains a dump; fakenect's readers know no other description.
        let assumed = self.layout != Layout::Dump && !self.root.join(DESCRIPTION).is_file();
        if self.recodes() || assumed {
            let sensor = Sensor { code: self.raw.code, ..self.sensor.clone() };
            let listed = images.iter().map(|i| (i.source.timestamp, i.file.with_extension("png")));
            // In a list, captures would pass for a film.
            let layout = if recording.captures { Layout::Images } else { self.layout };
            describe(self.output, layout, &sensor, listed)?;
        }
        Ok(corrected)
    }

    fn recodes(&self) -> bool {
        self.raw.code != self.sensor.code
    }

    /// All files except the depth images. In another code, views that could not be read are left out, and so
    /// is a dump's index: both would pass for that code.
    fn other_files(&self, images: &[Image], recording: &Recording) -> Result<Vec<PathBuf>> {
        if self.layout == Layout::Container {
            return Ok(Vec::new());
        }
        let images: HashSet<&Path> = images.iter().map(|i| i.file.as_path()).collect();
        let old_code = |f: &Path| {
            let mut unread = recording.excluded.iter().map(|e| Path::new(&e.view));
            (self.layout == Layout::Dump && f == Path::new(INDEX))
                || (self.layout == Layout::Recording && unread.any(|view| f.starts_with(view)))
        };
        let descriptions =
            recording.described_by.iter().filter_map(|f| f.strip_prefix(self.root).ok());
        let read: HashSet<&Path> = images.iter().copied().chain(descriptions).collect();
        let mut files = files_below(self.root, &read)?;
        files.retain(|f| !(images.contains(f.as_path()) || self.recodes() && old_code(f)));
        Ok(files)
    }

    fn read(&self, image: &Image) -> Result<Frame> {
        let camera = &self.sensor.camera;
        read_depth(&image.source, camera.width, camera.height)
    }

    /// Depths before and after the correction, m.
    fn depths(&self, frame: &Frame, image: &Image) -> Result<(Vec<f32>, Vec<f32>)> {
        let before = self.table.depths(frame);
        let mut after = before.clone();
        self.correction.apply(&mut after, &image.conditions)?;
        Ok((before, after))
    }

    /// Largest corrected depth, m.
    pub fn max_depth(&self, images: &[Image]) -> Result<f64> {
        let of = |image: &Image| -> Result<f64> {
            // Unreadable images are reported when they are written.
            let Ok(frame) = self.read(image) else { return Ok(0.0) };
            let (_, depth) = self.depths(&frame, image)?;
            Ok(depth.iter().filter(|z| z.is_finite()).fold(0f32, |a, &b| a.max(b)).into())
        };
        let each: Vec<Result<f64>> = images.par_iter().map(of).collect();
        let farthest = each.into_iter().try_fold(0.0, |far, z| Ok(f64::max(far, z?)))?;
        Ok(farthest.min(FARTHEST_M))
    }

    fn image(&self, image: &Image) -> Result<Tally> {
        let source = &image.source;
        let mut target = self.output.join(&image.file);
        let is_pgm = target.extension().is_some_and(|e| e.eq_ignore_ascii_case("pgm"));
        // A dump in another code becomes a described sequence, whose images are PNGs.
        let becomes_png = self.recodes() && self.layout == Layout::Dump;
        if becomes_png {
            target.set_extension("png");
        }
        make_folder_of(&target)?;
        let stored = || read_image(&source.path);
        let mut frame = match self.read(image) {
            Ok(frame) => frame,
            Err(why) if source.within.is_some() => return Err(why),
            Err(why) => {
                write_atomic(&target, &stored()?)?;
                return Ok(Tally { unread: Some(why.to_string()), ..Tally::default() });
            }
        };
        let (before, after) = self.depths(&frame, image)?;
        let tally = self.recode(&mut frame, &before, &after);
        let bytes = match (tally.changed, is_pgm) {
            (0, _) if !self.recodes() && source.within.is_none() => stored()?,
            (_, true) if !becomes_png => encode_pgm16(&frame),
            _ => encode_corrected(&frame)?,
        };
        write_atomic(&target, &bytes)?;
        if let Some(folder) = self.sigma {
            self.write_sigma(&folder.join(image.file.with_extension("png")), &after, image)?;
        }
        Ok(tally)
    }

    fn write_sigma(&self, target: &Path, depth_m: &[f32], image: &Image) -> Result<()> {
        let sigma = self.correction.uncertainty_m(depth_m, &image.conditions)?;
        let word = |s: &f32| sigma_word(f64::from(*s));
        let (width, height) = (self.sensor.camera.width, self.sensor.camera.height);
        let frame = Frame { width, height, raw: sigma.iter().map(word).collect() };
        make_folder_of(target)?;
        write_atomic(target, &encode_png16(&frame)?)
    }

    /// Stores the corrected depths; pixels without a measurement stay without one.
    fn recode(&self, frame: &mut Frame, before: &[f32], after: &[f32]) -> Tally {
        let mut tally = Tally::default();
        let none = self.raw.code.raw(f64::NAN);
        // Half a px beyond the range still counts as inside.
        let beyond = self.correction.learnt_px().map(|[low, high]| {
            let far_px = (low - 0.5).max(0.0);
            [self.correction.scale_px_m / (high + 0.5), self.correction.scale_px_m / far_px]
        });
        for (raw, (&z, &better)) in frame.raw.iter_mut().zip(before.iter().zip(after)) {
            let old = *raw;
            if z.is_nan() {
                *raw = if self.recodes() { none } else { old };
                continue;
            }
            tally.measured += 1;
            let learnt = |[near, far]: [f64; 2]| (near..=far).contains(&f64::from(z));
            tally.beyond += usize::from(beyond.is_some_and(|ends| !learnt(ends)));
            if z == better && !self.recodes() {
                continue;
            }
            let (nearest, clamped) = self.raw.nearest(better);
            *raw = nearest;
            tally.clamped += usize::from(clamped);
            tally.changed += usize::from(if self.recodes() { better != z } else { nearest != old });
            // A clamped depth counts with the depth that was stored.
            let stored = match clamped {
                true => self.raw.code.metres(nearest).unwrap_or(0.0),
                false => f64::from(better),
            };
            tally.square_m2 += (stored - f64::from(z)).powi(2);
        }
        tally
    }

    fn sum(&self, tallies: &[Tally], recording: &Recording) -> Result<Corrected> {
        let unread: Vec<&String> = tallies.iter().filter_map(|t| t.unread.as_ref()).collect();
        if let (Some(first), true) = (unread.first(), unread.len() == tallies.len()) {
            let what = format!("no depth image can be read; the first: {first}");
            return Err(Error::recording(self.root, what, "record it again"));
        }
        let total = |of: fn(&Tally) -> usize| tallies.iter().map(of).sum::<usize>();
        let measured = total(|t| t.measured);
        // Summed in frame order, whichever thread finished first.
        let square: f64 = tallies.iter().map(|t| t.square_m2).sum();
        let mut remarks = recording.remarks.clone();
        remarks.extend(self.correction.remarks().iter().cloned());
        let excluded = recording.excluded.iter();
        let kept = if self.recodes() { "left out" } else { "copied as it is" };
        remarks.extend(excluded.map(|e| format!("view {} is {kept}: {}", e.view, e.reason)));
        remarks.extend(unread.iter().map(|why| format!("copied as it is: {why}")));
        let beyond = total(|t| t.beyond);
        if let (Some([low, high]), true) = (self.correction.learnt_px(), beyond * 100 > measured) {
            let metres = |px: f64| self.correction.scale_px_m / px;
            remarks.push(format!(
                "{:.0} % of the depths lie outside {:.2} to {:.2} m (disparities of {high:.1} to {low:.1} px), where the correction was learnt: there it is held at the edge",
                100.0 * beyond as f64 / measured.max(1) as f64,
                metres(high),
                metres(low)
            ));
        }
        Ok(Corrected {
            frames: tallies.len() - unread.len(),
            measured,
            changed: total(|t| t.changed),
            clamped: total(|t| t.clamped),
            beyond: total(|t| t.beyond),
            rms_shift_m: (square / measured.max(1) as f64).sqrt(),
            code: self.raw.code,
            ignored: self.correction.ignored().to_vec(),
            remarks,
        })
    }
}
