//! Block matching: which shift of the reference looks most like the picture.
//!
//! Normalised cross-correlation (zero mean) over a square window, every candidate tried for every
//! pixel, parabola through the best three.

use rayon::prelude::*;

use super::reference::Reference;
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

/// Match `picture` against `reference`.
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
    // A picture smaller than the window has no answer.
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

/// Of the parabola through three equidistant values, the middle one the largest; in steps.
fn vertex(left: f32, middle: f32, right: f32) -> f32 {
    let curvature = left - 2.0 * middle + right;
    if curvature < 0.0 { 0.5 * (left - right) / curvature } else { 0.0 }
}

/// A picture with the sums over the window about each pixel, row-major.
pub struct WindowedImage {
    pub width: usize,
    pub height: usize,
    pub grey: Vec<f32>,
    pub sum: Vec<f32>,
    /// Root of the summed squares about the window's mean; zero where nothing is to be seen.
    pub contrast: Vec<f32>,
}

impl WindowedImage {
    pub fn new(grey: &[u32], width: usize, half: usize) -> Self {
        let squares: Vec<u32> = grey.iter().map(|g| g * g).collect();
        let area = ((2 * half + 1) as f32).powi(2);
        let sum: Vec<f32> = window_sums(grey, width, half).iter().map(|&s| s as f32).collect();
        let contrast =
            |(&squares, &sum): (&u32, &f32)| (squares as f32 - sum * sum / area).max(0.0).sqrt();
        WindowedImage {
            width,
            height: grey.len() / width,
            grey: grey.iter().map(|&g| g as f32).collect(),
            contrast: window_sums(&squares, width, half).iter().zip(&sum).map(contrast).collect(),
            sum,
        }
    }

    pub fn row<'a>(&self, values: &'a [f32], v: usize) -> &'a [f32] {
        &values[v * self.width..][..self.width]
    }
}

/// Sum of each pixel's `(2 half + 1)^2` neighbourhood; zero where it does not fit. Exact.
fn window_sums(values: &[u32], width: usize, half: usize) -> Vec<u32> {
    let height = values.len() / width;
    let side = 2 * half + 1;
    let mut sums = vec![0; values.len()];
    let mut columns = vec![0u32; width];
    for bottom in 0..height {
        let row = &values[bottom * width..][..width];
        columns.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        if bottom >= side {
            let old = &values[(bottom - side) * width..][..width];
            columns.iter_mut().zip(old).for_each(|(sum, value)| *sum -= value);
        }
        if bottom + 1 >= side && width >= side {
            let out = &mut sums[(bottom - half) * width..][..width];
            let mut sum: u32 = columns[..side - 1].iter().sum();
            for right in side - 1..width {
                sum += columns[right];
                out[right - half] = sum;
                sum -= columns[right + 1 - side];
            }
        }
    }
    sums
}

/// Candidates are worked on in groups of this size: a multiple of any vector register.
pub const LANES: usize = 8;

/// For every column u and candidate k the products picture(u) * reference(u, k), summed over the
/// rows of the window; k runs fastest, so that every loop below is a plain vector loop.
///
/// Picture and reference hold whole numbers of 10 and 8 bits: 31 rows stay below 2^24, so that
/// single precision is exact and adding and taking away leaves no trace.
pub struct ColumnProducts {
    width: usize,
    candidates: usize,
    sums: Vec<f32>,
}

/// A row of the picture and the same row of the reference, mirrored, so that the candidates of
/// column u are `reference[width - 1 - u..]` in order.
#[derive(Clone, Copy)]
pub struct RowPair<'a> {
    pub picture: &'a [f32],
    pub reference: &'a [f32],
}

impl ColumnProducts {
    pub fn new(width: usize, candidates: usize) -> Self {
        ColumnProducts { width, candidates, sums: vec![0.0; width * candidates] }
    }

    pub fn of(&self, column: usize) -> &[f32] {
        &self.sums[column * self.candidates..][..self.candidates]
    }

    pub fn enter(&mut self, row: RowPair) {
        let n = self.candidates;
        for (u, sums) in self.sums.chunks_exact_mut(n).enumerate() {
            let grey = row.picture[u];
            let reference = &row.reference[self.width - 1 - u..][..n];
            sums.iter_mut().zip(reference).for_each(|(s, r)| *s += grey * r);
        }
    }

    pub fn exchange(&mut self, enters: RowPair, leaves: RowPair) {
        let n = self.candidates;
        for (u, sums) in self.sums.chunks_exact_mut(n).enumerate() {
            let (new, old) = (enters.picture[u], leaves.picture[u]);
            let place = self.width - 1 - u;
            let fresh = &enters.reference[place..][..n];
            let stale = &leaves.reference[place..][..n];
            for ((s, f), o) in sums.iter_mut().zip(fresh).zip(stale) {
                *s += new * f - old * o;
            }
        }
    }
}

/// The largest value and its first place.
pub fn best(scores: &[f32]) -> (usize, f32) {
    let mut lanes = [f32::NEG_INFINITY; LANES];
    for group in scores.chunks_exact(LANES) {
        for (top, &s) in lanes.iter_mut().zip(group) {
            // Not f32::max, whose care for NaN costs a branch a lane.
            *top = if s > *top { s } else { *top };
        }
    }
    let top = lanes.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
    let place = scores.iter().position(|&s| s == top).unwrap_or(0);
    (place, top)
}

#[cfg(test)]
mod tests {
    use super::vertex;
    use super::*;

    #[test]
    fn the_vertex_of_a_parabola_is_found_exactly() {
        let y = |x: f32| 3.0 - 2.0 * (x - 0.3) * (x - 0.3);
        assert!((vertex(y(-1.0), y(0.0), y(1.0)) - 0.3).abs() < 1e-6);
        assert_eq!(vertex(1.0, 1.0, 1.0), 0.0);
    }

    #[test]
    fn window_sums_are_the_sums_over_windows() {
        let values: Vec<u32> = (0..70u32).map(|i| i * i % 101).collect();
        let sums = window_sums(&values, 10, 1);
        let expected: u32 =
            (2..5).flat_map(|v| (4..7).map(move |u| v * 10 + u)).map(|i| values[i]).sum();
        assert_eq!(sums[3 * 10 + 5], expected);
        assert_eq!(sums[0], 0);
        assert_eq!(sums[6 * 10 + 5], 0, "the last row has no whole window");
    }

    #[test]
    fn the_best_is_the_first_of_the_largest() {
        let mut scores = vec![0.0f32; 24];
        scores[13] = 2.0;
        scores[21] = 2.0;
        assert_eq!(best(&scores), (13, 2.0));
    }
}
