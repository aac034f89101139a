//! Block matching: finds the shift of the reference most similar to the picture.
//!
//! Zero-mean normalised cross-correlation over a square window, every candidate tried for every pixel,
//! parabola through the best three.

use rayon::prelude::*;

use super::reference::{ColumnProducts, Reference, RowPair, WindowedImage, best};
use crate::frame::Frame;

/// What the matcher found for a picture.
pub struct Match {
    /// Shift against the reference, px; NaN where nothing was found. Row-major.
    pub shift: Vec<f32>,
    /// Normalised cross-correlation there, -1 to 1.
    pub correlation: Vec<f32>,
}

/// Rows per task; its first window takes `2 half` rows more.
const BAND: usize = 96;

pub fn find(picture: &Frame, reference: &Reference) -> Match {
    let grey: Vec<u32> = picture.raw.iter().map(|&w| u32::from(w)).collect();
    let image = WindowedImage::new(&grey, picture.width, reference.half_window);
    let mut shift = vec![f32::NAN; grey.len()];
    let mut correlation = vec![0f32; grey.len()];
    shift
        .par_chunks_mut(BAND * image.width)
        .zip(correlation.par_chunks_mut(BAND * image.width))
        .enumerate()
        .for_each(|(band, (shift, correlation))| {
            match_band(&image, reference, band * BAND, shift, correlation);
        });
    Match { shift, correlation }
}

fn match_band(
    image: &WindowedImage,
    reference: &Reference,
    top: usize,
    shift: &mut [f32],
    correlation: &mut [f32],
) {
    let half = reference.half_window;
    let pair = |v: usize| RowPair {
        picture: image.row(&image.grey, v),
        reference: reference.image.row(&reference.image.grey, v),
    };
    let first = top.max(half);
    let end = (top + shift.len() / image.width).min(image.height.saturating_sub(half));
    // A picture smaller than the window has no match.
    if first >= end || image.width <= 2 * half {
        return;
    }
    let mut products = ColumnProducts::new(image.width, reference.candidates.count);
    (first - half..=first + half).for_each(|v| products.enter(pair(v)));
    for v in first..end {
        if v > first {
            products.exchange(pair(v + half), pair(v - half - 1));
        }
        let out = (v - top) * image.width..(v - top + 1) * image.width;
        match_row(image, reference, v, &products, &mut shift[out.clone()], &mut correlation[out]);
    }
}

fn match_row(
    image: &WindowedImage,
    reference: &Reference,
    v: usize,
    products: &ColumnProducts,
    shift: &mut [f32],
    correlation: &mut [f32],
) {
    let (half, n) = (reference.half_window, reference.candidates.count);
    let [mean, weight] = [&reference.mean, &reference.weight].map(|r| reference.image.row(r, v));
    let [sum, contrast] = [&image.sum, &image.contrast].map(|i| image.row(i, v));
    let mut window = vec![0f32; n];
    let mut scores = vec![0f32; n];
    let add = |window: &mut [f32], column: usize, sign: f32| {
        window.iter_mut().zip(products.of(column)).for_each(|(w, p)| *w += sign * p);
    };
    (0..2 * half).for_each(|column| add(&mut window, column, 1.0));
    for u in half..image.width - half {
        add(&mut window, u + half, 1.0);
        let (place, sum) = (image.width - 1 - u, sum[u]);
        let candidates = mean[place..][..n].iter().zip(&weight[place..][..n]);
        for ((score, w), (m, r)) in scores.iter_mut().zip(&window).zip(candidates) {
            *score = (w - sum * m) * r;
        }
        add(&mut window, u - half, -1.0);
        let (k, top) = best(&scores);
        // The ends of the range have no neighbour for the parabola.
        if k > 0 && k + 1 < n && contrast[u] > 0.0 {
            correlation[u] = top / contrast[u];
            shift[u] = (reference.candidates.first + k as i64) as f32
                + vertex(scores[k - 1], top, scores[k + 1]);
        }
    }
}

/// Vertex of the parabola through three equidistant values, the middle one the largest; in steps from it.
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
