//! What a stored word was before it was rounded: as like as can be told from its neighbours.
//!
//! An error of less than a step is added before rounding, not after. Where in its step a value lay
//! is equally likely anywhere, so the places are handed out evenly; and neighbours err together, so
//! those whose neighbours are higher get the higher places. Drawn blindly, they would add a quarter
//! of a squared step of noise that the sensor does not have.

use rand::Rng;

use crate::frame::Frame;
use crate::rng::Stream;

/// Half a side of the neighbourhood, px.
const REACH: usize = 2;
/// Tells equals apart, steps.
const TIE: f32 = 0.04;

/// Place of each word's value within its step, -1/2 to 1/2; 0 where `valid` says no.
pub(super) fn fractions(frame: &Frame, valid: &[bool], rng: &mut Stream) -> Vec<f32> {
    let mut lean: Vec<(f32, u32)> = Vec::new();
    for (i, ok) in valid.iter().enumerate() {
        if *ok {
            let tie = rng.random_range(-TIE..TIE);
            lean.push((above(frame, valid, i) + tie, i as u32));
        }
    }
    lean.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut fractions = vec![0.0; valid.len()];
    let step = 1.0 / lean.len().max(1) as f32;
    for (rank, (_, i)) in lean.iter().enumerate() {
        fractions[*i as usize] = (rank as f32 + 0.5) * step - 0.5;
    }
    fractions
}

/// By how much the neighbours' mean is above a word. Pairs on either side take a slope out.
fn above(frame: &Frame, valid: &[bool], i: usize) -> f32 {
    let (u, v) = (i % frame.width, i / frame.width);
    let (across, down) =
        (REACH.min(u).min(frame.width - 1 - u), REACH.min(v).min(frame.height - 1 - v));
    let (mut sum, mut n) = (0.0, 0);
    for dv in 0..=2 * down {
        for du in 0..=2 * across {
            let j = (v + dv - down) * frame.width + u + du - across;
            let twin = 2 * i - j;
            let off = f32::from(frame.words[j]) - f32::from(frame.words[i]);
            // An edge is no neighbour.
            if valid[j] && valid[twin] && off.abs() <= EDGE {
                sum += off;
                n += 1;
            }
        }
    }
    if n == 0 { 0.0 } else { sum / n as f32 }
}

/// Steps.
const EDGE: f32 = 12.0;
