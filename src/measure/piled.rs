//! Depth that is cut off at an end of the sensor's range: what lies beyond is stored as the last word, and would be
//! measured as a wall without noise.

use std::fmt;

use super::Workbench;
use crate::frame::Frame;

/// A pile is so many times as frequent as any of the words beside it: noise of a quarter of a step, less than a Kinect
/// has on a frontal wall, leaves one reading in 43 in either of them.
const TIMES_BESIDE: u64 = 50;
const BESIDE: usize = 4;
/// Of the readings; fewer harm nothing.
const MIN_SHARE: f64 = 0.01;
/// Noise of fewer words tells no end from a middle.
const MIN_WORDS: usize = 8;

/// The word at an end of all that a view's frames hold, if readings pile up there.
#[derive(Debug)]
pub(super) struct Piled {
    word: u16,
    metres: f32,
    share: f64,
    /// Pixels that showed it.
    pixels: Vec<usize>,
    /// The word for "no measurement".
    none: u16,
}

impl Piled {
    pub fn among<'f>(
        frames: impl Iterator<Item = &'f Frame> + Clone,
        bench: &Workbench<'_>,
    ) -> Option<Self> {
        let mut counts = vec![0u64; 1 << 16];
        frames
            .clone()
            .flat_map(|frame| &frame.raw)
            .for_each(|&word| counts[usize::from(word)] += 1);
        let metres = |word: usize| bench.table.metres(word as u16);
        let seen: Vec<usize> =
            (0..counts.len()).filter(|&w| counts[w] > 0 && metres(w).is_finite()).collect();
        let total: u64 = seen.iter().map(|&word| counts[word]).sum();
        let is_pile = |word: usize, beside: &mut dyn Iterator<Item = &usize>| {
            let most = beside.take(BESIDE).map(|&other| counts[other]).max().unwrap_or(0);
            counts[word] > TIMES_BESIDE * most && counts[word] as f64 > MIN_SHARE * total as f64
        };
        let (&first, &last) = (seen.first()?, seen.last()?);
        let ends = [
            (first, is_pile(first, &mut seen.iter().skip(1))),
            (last, is_pile(last, &mut seen.iter().rev().skip(1))),
        ];
        let (word, _) = ends.into_iter().find(|end| seen.len() >= MIN_WORDS && end.1)?;
        let shown = |i: &usize| frames.clone().any(|frame| usize::from(frame.raw[*i]) == word);
        let pixels = (0..bench.sensor.camera.pixels()).filter(shown).collect();
        Some(Piled {
            word: word as u16,
            metres: metres(word),
            share: counts[word] as f64 / total as f64,
            pixels,
            none: bench.sensor.code.raw(f64::NAN),
        })
    }

    /// Pixels that are cut off now and then are so in all frames: what is left of their noise is one side of it.
    pub fn take_out(&self, frame: &mut Frame) {
        self.pixels.iter().for_each(|&i| frame.raw[i] = self.none);
        let piled = frame.raw.iter_mut().filter(|word| **word == self.word);
        piled.for_each(|word| *word = self.none);
    }
}

impl fmt::Display for Piled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:.1} % of its readings are one word, {:.3} m, the end of all that it shows: depth seems to be cut off \
             there, and the pixels that show it were left out",
            100.0 * self.share,
            self.metres
        )
    }
}
