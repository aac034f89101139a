//! What a stored word was before it was rounded: as like as can be told from its neighbours.
//!
//! An error of less than a step is added before rounding, not after. Where in its step a value lay
//! is equally likely anywhere, so the places are handed out evenly; and neighbours err together, so
//! those whose neighbours are higher get the higher places. How far the neighbours are believed is
//! weighed against a lot until the places tell of the values what rounding leaves: nothing, so that
//! they go against the words by the variance of a step, 1/12. Drawn by lot alone they would add a
//! sixth of a squared step of noise that the sensor does not have, and by the neighbours alone they
//! would smooth it.

use crate::raytraced::borrow::{Window, fresh};
use kinoise::frame::Frame;
use kinoise::rng::{Seed, Stream};
use rand::Rng;

/// Half a side of the neighbourhood, px.
const REACH: usize = 2;
/// Words farther apart lie on two surfaces, steps.
const EDGE: f32 = 12.0;
/// Side of the window of the lot, px: as wide as the neighbourhood.
const LOT_PX: f64 = 4.0;
/// Every so many pixels are looked at to weigh it.
const APART: usize = 7;
const ROUNDS: usize = 10;
const MAX_WEIGHT: f32 = 30.0;

/// A frame, and how far its words are from what is expected there, steps; NaN where nothing is.
pub(super) struct Words<'a> {
    pub frame: &'a Frame,
    pub valid: &'a [bool],
    pub off: &'a [f32],
}

/// Place of each word's value within its step, -1/2 to 1/2; 0 where there is no value.
pub(super) fn places(words: &Words<'_>, rng: &mut Stream) -> Vec<f32> {
    let count = words.valid.len();
    let lean: Vec<f32> = (0..count).map(|i| words.above(i)).collect();
    let mut lot = fresh(Seed(rng.random()), 0, 0, count);
    Window::bell(LOT_PX).blur(&mut lot, words.frame.width);
    let score = |weight: f32, i: usize| lean[i] + weight * lot[i];
    let looked: Vec<usize> =
        (0..count).step_by(APART).filter(|&i| words.off[i].is_finite()).collect();
    let (mut low, mut high) = (1e-3f32.ln(), MAX_WEIGHT.ln());
    for _ in 0..ROUNDS {
        let middle = 0.5 * (low + high);
        let placed = by_rank(looked.iter().map(|&i| (score(middle.exp(), i), i)).collect());
        if covariance(&placed, words.off) < -1.0 / 12.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let weight = (0.5 * (low + high)).exp();
    let all = (0..count).filter(|&i| words.valid[i]).map(|i| (score(weight, i), i)).collect();
    let mut places = vec![0.0; count];
    by_rank(all).into_iter().for_each(|(place, i)| places[i] = place);
    places
}

/// Evenly from -1/2 to 1/2, in the order of the scores.
fn by_rank(mut scores: Vec<(f32, usize)>) -> Vec<(f32, usize)> {
    scores.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let step = 1.0 / scores.len().max(1) as f32;
    for (rank, (score, _)) in scores.iter_mut().enumerate() {
        *score = (rank as f32 + 0.5) * step - 0.5;
    }
    scores
}

/// The places have no mean.
fn covariance(placed: &[(f32, usize)], off: &[f32]) -> f64 {
    let product = |(place, i): &(f32, usize)| f64::from(*place) * f64::from(off[*i]);
    placed.iter().map(product).sum::<f64>() / placed.len().max(1) as f64
}

impl Words<'_> {
    /// By how much the neighbours' mean is above a word. Pairs on either side take a slope out.
    fn above(&self, i: usize) -> f32 {
        if !self.valid[i] {
            return 0.0;
        }
        let Frame { width, height, raw: words } = self.frame;
        let (u, v) = (i % width, i / width);
        let (across, down) = (REACH.min(u).min(width - 1 - u), REACH.min(v).min(height - 1 - v));
        let (mut sum, mut n) = (0.0, 0);
        for dv in 0..=2 * down {
            for du in 0..=2 * across {
                let j = (v + dv - down) * width + u + du - across;
                let off = f32::from(words[j]) - f32::from(words[i]);
                if self.valid[j] && self.valid[2 * i - j] && off.abs() <= EDGE {
                    sum += off;
                    n += 1;
                }
            }
        }
        if n == 0 { 0.0 } else { sum / n as f32 }
    }
}
