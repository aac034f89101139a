//! Block matching: which shift of the reference looks most like the picture.
//!
//! Normalised cross-correlation (zero mean) over a square window, every candidate tried for every
//! pixel, parabola through the best three.

use rayon::prelude::*;

use super::reference::Reference;
use super::scores::{ColumnProducts, RowPair, best, window_sums};
use crate::frame::Frame;

/// What the matcher found for a picture.
pub struct Match {
    /// Shift against the reference, px; NaN where nothing was found. Row-major.
    pub shift: Vec<f32>,
    /// Normalised cross-correlation there, -1 to 1.
    pub correlation: Vec<f32>,
}

/// Rows a task works on; its first window costs it `2 half` rows more.
const BAND: usize = 96;

/// The picture with its window sums.
struct Seen {
    width: usize,
    height: usize,
    grey: Vec<f32>,
    sum: Vec<u32>,
    square_sum: Vec<u32>,
}

impl Seen {
    fn of(picture: &Frame, half: usize) -> Self {
        let grey: Vec<u32> = picture.raw.iter().map(|&w| u32::from(w)).collect();
        let squares: Vec<u32> = grey.iter().map(|g| g * g).collect();
        Seen {
            width: picture.width,
            height: picture.height,
            sum: window_sums(&grey, picture.width, half),
            square_sum: window_sums(&squares, picture.width, half),
            grey: grey.iter().map(|&g| g as f32).collect(),
        }
    }

    fn row(&self, v: usize) -> &[f32] {
        &self.grey[v * self.width..][..self.width]
    }
}

/// Match `picture` against `reference`.
pub fn find(picture: &Frame, reference: &Reference) -> Match {
    let seen = Seen::of(picture, reference.half_window);
    let mut shift = vec![f32::NAN; seen.grey.len()];
    let mut correlation = vec![0f32; seen.grey.len()];
    shift
        .par_chunks_mut(BAND * seen.width)
        .zip(correlation.par_chunks_mut(BAND * seen.width))
        .enumerate()
        .for_each(|(band, (shift, correlation))| {
            match_band(&seen, reference, band * BAND, shift, correlation);
        });
    Match { shift, correlation }
}

fn match_band(
    seen: &Seen,
    reference: &Reference,
    top: usize,
    shift: &mut [f32],
    correlation: &mut [f32],
) {
    let half = reference.half_window;
    let pair = |v: usize| RowPair { picture: seen.row(v), reference: reference.row(v).grey };
    let first = top.max(half);
    let end = (top + shift.len() / seen.width).min(seen.height.saturating_sub(half));
    // A picture smaller than the window has no answer.
    if first >= end || seen.width <= 2 * half {
        return;
    }
    let mut products = ColumnProducts::new(seen.width, reference.candidates.count);
    (first - half..=first + half).for_each(|v| products.enter(pair(v)));
    for v in first..end {
        if v > first {
            products.exchange(pair(v + half), pair(v - half - 1));
        }
        let out = (v - top) * seen.width..(v - top + 1) * seen.width;
        match_row(seen, reference, v, &products, &mut shift[out.clone()], &mut correlation[out]);
    }
}

fn match_row(
    seen: &Seen,
    reference: &Reference,
    v: usize,
    products: &ColumnProducts,
    shift: &mut [f32],
    correlation: &mut [f32],
) {
    let (half, n) = (reference.half_window, reference.candidates.count);
    let row = reference.row(v);
    let area = ((2 * half + 1) as f32).powi(2);
    let mut window = vec![0f32; n];
    let mut scores = vec![0f32; n];
    let add = |window: &mut [f32], column: usize, sign: f32| {
        window.iter_mut().zip(products.of(column)).for_each(|(w, p)| *w += sign * p);
    };
    (0..2 * half).for_each(|column| add(&mut window, column, 1.0));
    for u in half..seen.width - half {
        add(&mut window, u + half, 1.0);
        let place = seen.width - 1 - u;
        let (mean, weight) = (&row.mean[place..][..n], &row.weight[place..][..n]);
        let sum = seen.sum[v * seen.width + u] as f32;
        for (((score, w), m), r) in scores.iter_mut().zip(&window).zip(mean).zip(weight) {
            *score = (w - sum * m) * r;
        }
        add(&mut window, u - half, -1.0);
        let about_mean = seen.square_sum[v * seen.width + u] as f32 - sum * sum / area;
        let (k, top) = best(&scores);
        // The ends of the range have no neighbour for the parabola.
        if k > 0 && k + 1 < n && about_mean > 0.0 {
            correlation[u] = top / about_mean.sqrt();
            shift[u] = (reference.candidates.first + k as i64) as f32
                + vertex(scores[k - 1], top, scores[k + 1]);
        }
    }
}

/// Of the parabola through three equidistant values, the middle one the largest; in steps.
fn vertex(left: f32, middle: f32, right: f32) -> f32 {
    let curvature = left - 2.0 * middle + right;
    if curvature < 0.0 { 0.5 * (left - right) / curvature } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::vertex;

    #[test]
    fn the_vertex_of_a_parabola_is_found_exactly() {
        let y = |x: f32| 3.0 - 2.0 * (x - 0.3) * (x - 0.3);
        assert!((vertex(y(-1.0), y(0.0), y(1.0)) - 0.3).abs() < 1e-6);
        assert_eq!(vertex(1.0, 1.0, 1.0), 0.0);
    }
}
