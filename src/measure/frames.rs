//! Finds a view's target and iterates over its frames, skipping unreadable and repeated ones.

use super::Workbench;
use super::follow::MAJORITY;
use super::grouping::words_a_step;
use super::mean::mean_inverse_depth;
use super::scan::{HELD_FRAMES, Scan};
use crate::error::{Error, Result};
use crate::frame::{DepthTable, Frame};
use crate::io::FrameSource;
use crate::plane::{InverseDepthImage, Target, find_target};
use crate::view::{FrameRef, View};

/// Iterates over the frames that can be read and do not repeat the one before; notes name the others.
pub(super) struct FrameReader<'v> {
    frames: std::iter::Enumerate<std::slice::Iter<'v, FrameRef>>,
    source: FrameSource,
    notes: Vec<String>,
    table: &'v DepthTable,
    before: Vec<u16>,
    /// Numbers of the frames that repeat the one before.
    repeated: Vec<usize>,
}

impl<'v> FrameReader<'v> {
    pub fn of(view: &'v View, bench: &'v Workbench<'_>) -> Self {
        let camera = &bench.sensor.camera;
        FrameReader {
            frames: view.depth.iter().enumerate(),
            source: FrameSource::new(camera.width, camera.height),
            notes: Vec::new(),
            table: &bench.table,
            before: Vec::new(),
            repeated: Vec::new(),
        }
    }

    /// Notes on the frames read, and the hash of their bytes.
    pub fn finish(self, view: &View) -> (Vec<String>, [u8; 32]) {
        let (repeated, total) = (self.repeated.len(), view.depth.len());
        let told = (repeated > 0).then(|| {
            format!(
                "{repeated} of {total} frames left out: word for word the frame before; counted as \
                 measurements of their own they would make temporal sigma wrong"
            )
        });
        (self.notes.into_iter().chain(told).collect(), self.source.digest())
    }

    /// The first frames, and their numbers in the view.
    pub fn hold(&mut self, view: &View) -> Result<(Vec<usize>, Vec<Frame>)> {
        let (numbers, held): (Vec<usize>, Vec<Frame>) = self.by_ref().take(HELD_FRAMES).unzip();
        if held.is_empty() {
            let why = self.notes.first().cloned().unwrap_or_else(|| "it has no frame".into());
            return Err(failed(view, why, "record the view again"));
        }
        Ok((numbers, held))
    }
}

impl Iterator for FrameReader<'_> {
    /// A frame with its number in the view.
    type Item = (usize, Frame);

    fn next(&mut self) -> Option<(usize, Frame)> {
        while let Some((number, frame_ref)) = self.frames.next() {
            match self.source.frame(frame_ref) {
                Ok(f) if f.raw == self.before => self.repeated.push(number),
                Ok(f) if f.raw.iter().any(|&raw| self.table.metres(raw).is_finite()) => {
                    self.before.clone_from(&f.raw);
                    return Some((number, f));
                }
                Ok(_) => self.notes.push(format!(
                    "frame left out: {}: no pixel carries a depth",
                    frame_ref.place()
                )),
                Err(e) => self.notes.push(format!("frame left out: {e}")),
            }
        }
        None
    }
}

/// Finds the target of a view in its first frames.
pub fn view_target(view: &View, bench: &Workbench<'_>) -> Result<Target> {
    let (_, held) = FrameReader::of(view, bench).hold(view)?;
    target_of(view, bench, &held)
}

pub(super) fn target_of(view: &View, bench: &Workbench<'_>, held: &[Frame]) -> Result<Target> {
    let words = held.iter().flat_map(|frame| frame.raw.iter().copied());
    let words_a_step = words_a_step(words, &bench.table);
    let mut w = mean_inverse_depth(held, bench, words_a_step);
    if bench.ray_share != 0.0 {
        for (i, w) in w.iter_mut().enumerate() {
            let (x, y) = bench.rays.at(i);
            let foreshortening = (1.0 + x * x + y * y).sqrt().recip();
            *w /= (1.0 - bench.ray_share * (1.0 - foreshortening)) as f32;
        }
    }
    let image = InverseDepthImage {
        w: &w,
        rays: &bench.rays,
        camera: &bench.sensor.camera,
        step: &|w| bench.step(words_a_step, w),
    };
    let mut rng = bench.options.seed.stream(&format!("target/{}", view.name));
    let remedy = "give the target's region in view.json (roi or polygon), or record the view again";
    find_target(&image, view.notes.region.as_ref(), &mut rng)
        .map_err(|what| failed(view, what, remedy))
}

pub(super) fn failed(view: &View, what: String, remedy: &'static str) -> Error {
    Error::View { view: view.name.clone(), what, remedy }
}

/// Numbers of frames left out, by reason.
#[derive(Debug, Clone, Copy, Default)]
pub struct LeftOut {
    /// Identical to the frame before.
    pub repeated: usize,
    /// They show the target elsewhere than the other first frames.
    pub stale: usize,
    /// They cannot be read, or have no depth.
    pub lost: usize,
}

/// The frames that show a view's target, with their numbers in the view.
///
/// Frames that repeat the one before are left out, unless all frames of the view are equal. So are a few of
/// the first ones in which most of the target is elsewhere. Later ones stay: motion is left to the diagnosis.
pub struct TargetFrames<'v> {
    first: Box<dyn Iterator<Item = (usize, Frame)> + 'v>,
    stale: usize,
    reader: FrameReader<'v>,
}

/// Stale frames at most at the beginning of a recording: usually one, of eight frames perhaps two. Where more
/// show the target elsewhere, it moves or they jitter.
const MAX_STALE: [usize; 2] = [1, 2];

impl<'v> TargetFrames<'v> {
    /// Finds the target and its frames. Fails when no frame can be read or none shows a plane.
    pub fn of(view: &'v View, bench: &'v Workbench<'_>) -> Result<(Target, Self)> {
        let mut reader = FrameReader::of(view, bench);
        let (numbers, mut held) = reader.hold(view)?;
        let target = target_of(view, bench, &held)?;
        if held.len() == 1 && !reader.repeated.is_empty() {
            let alike = numbers.into_iter().chain(std::mem::take(&mut reader.repeated));
            let frame = held.swap_remove(0);
            let first = Box::new(alike.map(move |number| (number, frame.clone())));
            return Ok((target, TargetFrames { first, stale: 0, reader }));
        }
        let mut taken = vec![true; held.len()];
        if held.len() >= MAJORITY {
            let mut scan = Scan::begin(bench, &target, &held);
            taken = held.iter().map(|frame| scan.shifts(frame).is_some()).collect();
        }
        let elsewhere = taken.iter().filter(|taken| !**taken).count();
        let moves = elsewhere > MAX_STALE[usize::from(held.len() == HELD_FRAMES)];
        let first = numbers.into_iter().zip(held).zip(taken);
        let first = first.filter_map(move |(frame, taken)| (taken || moves).then_some(frame));
        let stale = if moves { 0 } else { elsewhere };
        Ok((target, TargetFrames { first: Box::new(first), stale, reader }))
    }

    /// Frames left out so far.
    pub fn left_out(&self) -> LeftOut {
        let FrameReader { repeated, notes, .. } = &self.reader;
        LeftOut { repeated: repeated.len(), stale: self.stale, lost: notes.len() }
    }
}

impl Iterator for TargetFrames<'_> {
    type Item = (usize, Frame);

    fn next(&mut self) -> Option<(usize, Frame)> {
        self.first.next().or_else(|| self.reader.next())
    }
}
