//! What a stored word was before it was rounded: as like as can be told from its neighbours.
//!
//! An error of less than a step is added before rounding, not after. Where in its step a value lay
//! is equally likely anywhere, so the places are handed out evenly; and neighbours err together, so
//! those whose neighbours are higher get the higher places. How far the neighbours are believed is
//! weighed against a lot until the places tell of the values what rounding leaves: nothing, so that
//! they go against the words by the variance of a step, 1/12. Drawn by lot alone they would add a
//! sixth of a squared step of noise that the sensor does not have, and by the neighbours alone they
//! would smooth it.

use rand_distr::{Distribution, StandardNormal};

use crate::raytraced::kernels::Window;
use kinoise::frame::Frame;
use kinoise::rng::Stream;

/// Half a side of the neighbourhood, px, and as wide a window for the lot.
const REACH: usize = 2;
const LOT_PX: f64 = 4.0;
/// Words farther apart lie on two surfaces, and what strays farther from its plane tells nothing of
/// rounding, steps.
const MAX_EDGE: f32 = 12.0;
const MAX_OFF: f32 = 50.0;
/// Every so many pixels are looked at to weigh the lot, so often, up to this weight.
const APART: usize = 7;
const ROUNDS: usize = 10;
const MAX_WEIGHT: f32 = 30.0;

/// Place of each word's value within its step, -1/2 to 1/2; 0 where there is no value. `off` is how
/// far a word is from what is expected there, steps; NaN where nothing is.
pub fn places(frame: &Frame, valid: &[bool], off: &[f32], rng: &mut Stream) -> Vec<f32> {
    let lean: Vec<f32> = (0..valid.len()).map(|i| neighbours_above(frame, valid, i)).collect();
    let mut lot: Vec<f32> = valid.iter().map(|_| StandardNormal.sample(&mut *rng)).collect();
    Window::bell(LOT_PX).blur(&mut lot, frame.width);
    // Evenly from -1/2 to 1/2, in the order of the scores.
    let placed = |weight: f32, mut pixels: Vec<usize>| -> Vec<(usize, f32)> {
        let score = |i: &usize| lean[*i] + weight * lot[*i];
        pixels.sort_by(|a, b| score(a).total_cmp(&score(b)).then(a.cmp(b)));
        let step = 1.0 / pixels.len().max(1) as f32;
        let place = |rank: usize| (rank as f32 + 0.5) * step - 0.5;
        pixels.into_iter().enumerate().map(|(rank, i)| (i, place(rank))).collect()
    };
    let looked: Vec<usize> =
        (0..valid.len()).step_by(APART).filter(|&i| off[i].abs() < MAX_OFF).collect();
    let (mut low, mut high) = (1e-3f32.ln(), MAX_WEIGHT.ln());
    for _ in 0..ROUNDS {
        let middle = 0.5 * (low + high);
        let products = placed(middle.exp(), looked.clone()).into_iter();
        let product: f64 = products.map(|(i, place)| f64::from(place * off[i])).sum();
        let against = 12.0 * product < -(looked.len() as f64);
        *(if against { &mut low } else { &mut high }) = middle;
    }
    let mut places = vec![0.0; valid.len()];
    let all = (0..valid.len()).filter(|&i| valid[i]).collect();
    placed((0.5 * (low + high)).exp(), all).into_iter().for_each(|(i, place)| places[i] = place);
    places
}

/// By how much the neighbours' mean is above a word. Pairs on either side take a slope out.
fn neighbours_above(frame: &Frame, valid: &[bool], i: usize) -> f32 {
    let Frame { width, height, raw: words } = frame;
    let (u, v) = (i % width, i / width);
    let (across, down) = (REACH.min(u).min(width - 1 - u), REACH.min(v).min(height - 1 - v));
    let (mut sum, mut n) = (0.0, 0);
    for dv in 0..=2 * down {
        for du in 0..=2 * across {
            let j = (v + dv - down) * width + u + du - across;
            let off = f32::from(words[j]) - f32::from(words[i]);
            if valid[i] && valid[j] && valid[2 * i - j] && off.abs() <= MAX_EDGE {
                sum += off;
                n += 1;
            }
        }
    }
    if n == 0 { 0.0 } else { sum / n as f32 }
}
