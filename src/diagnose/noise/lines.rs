//! Whole columns, or rows, that err by a constant each: their profile, as a term of the model.

use rayon::prelude::*;

use super::still::beside_bias;
use super::texture::pixel_scale;
use crate::diagnose::views::field::Field;
use crate::terms::{Axis, Basis, Coordinate, Modulation, Term};

/// Columns and rows of fewer readings over all views are left at nothing.
const FEWEST_READINGS: f64 = 200.0;

/// What a line's readings sum to in one view, and how many they are.
type Sums = Vec<(f64, f64)>;

/// The mean of every column, or of every row, over the views, px, without what is smooth; `bias` has what is
/// known to be no noise, by view and pixel, px. As a term, with the variance of each coefficient, px^2.
pub fn lines(fields: &[Field], bias: &[Vec<f32>], axis: Axis) -> (Vec<Term>, Vec<f64>) {
    let Some(first) = fields.first() else { return Default::default() };
    let (width, height) = (first.width, first.height);
    let (over, nodes) = match axis {
        Axis::Row => (Coordinate::Row, height),
        _ => (Coordinate::Column, width),
    };
    let by_view: Vec<Sums> = beside_bias(fields, bias)
        .par_iter()
        .map(|(field, bias)| {
            let mut sums = vec![(0.0, 0.0); nodes];
            let image = pixel_scale(field, &field.mean, bias);
            for (i, &r) in image.iter().enumerate().filter(|(_, r)| r.is_finite()) {
                let line = if axis == Axis::Row { i / width } else { i % width };
                sums[line].0 += f64::from(r);
                sums[line].1 += 1.0;
            }
            sums
        })
        .collect();
    let lines = (0..nodes).map(|line| mean(by_view.iter().map(|sums| sums[line])));
    let (coefficients, variances): (Vec<f64>, Vec<f64>) = lines.unzip();
    let high = nodes.saturating_sub(1) as f64;
    let profile = Basis::Curve { over, low: 0.0, high, nodes, times: Modulation::One };
    (vec![Term::bias(profile, coefficients)], variances)
}

/// Mean of a line, and its variance with the views as the sample.
fn mean(views: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let (mut sum, mut n) = (0.0, 0.0);
    views.clone().for_each(|(s, k)| (sum, n) = (sum + s, n + k));
    if n < FEWEST_READINGS {
        return (0.0, 0.0);
    }
    let mean = sum / n;
    let (mut square, mut seen) = (0.0, 0.0);
    for (s, k) in views.filter(|v| v.1 > 0.0) {
        square += (s - k * mean).powi(2);
        seen += 1.0;
    }
    (mean, square / (n * n) * seen / f64::max(seen - 1.0, 1.0))
}

#[cfg(test)]
#[path = "lines_tests.rs"]
mod tests;
