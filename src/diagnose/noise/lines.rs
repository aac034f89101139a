//! Whole columns, or rows, that err by a constant each: their profile, as a term of the model.

use rayon::prelude::*;

use super::still::beside_bias;
use super::texture::{PIXEL_BOX, pixel_scale};
use crate::diagnose::diagnosis::{Finding, Size};
use crate::diagnose::finding::parameters::one;
use crate::diagnose::views::field::Field;
use crate::stats::mean;
use crate::terms::{Axis, Basis, Coordinate, Modulation, Term};

/// Columns and rows of fewer readings over all views are left at nothing.
const FEWEST_READINGS: f64 = 200.0;

/// What a line's readings sum to in one view, and how many they are.
type Sums = Vec<(f64, f64)>;

/// Still lines that were found, with their profile, and as large as that is: the test looks at what changes from one
/// line to the next, of which two read-outs have more than columns that err independently.
pub fn learn(found: &mut Finding, fields: &[Field], bias: &[Vec<f32>]) {
    let (terms, variances) = lines(fields, bias, found.axis);
    let known =
        || terms.iter().flat_map(|t| &t.coefficients).zip(&variances).filter(|l| *l.1 > 0.0);
    let (n, variance) = (known().count() as f64, mean(known().map(|(_, v)| *v)).unwrap_or(0.0));
    let px2 = mean(known().map(|(c, v)| c * c - v)).unwrap_or(0.0);
    if let Some(told) = found.value("sigma_px").filter(|told| px2 > 0.0 && *told > 0.0) {
        let (sigma_px, error) = (px2.sqrt(), (variance / n * (1.0 + 0.5 * variance / px2)).sqrt());
        let times = sigma_px / told;
        found.parameters = one("sigma_px", sigma_px, error);
        found.size = Size { mm: times * found.size.mm, sigma: times * found.size.sigma };
    }
    (found.terms, found.covariance.variances) = (terms, variances);
}

/// The mean of every column, or of every row, over the views, px, without what is smooth; `bias` has what is
/// known to be no noise, by view and pixel, px. As a term, with the variance of each coefficient, px^2.
fn lines(fields: &[Field], bias: &[Vec<f32>], axis: Axis) -> (Vec<Term>, Vec<f64>) {
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
    let lines = (0..nodes).map(|line| of_line(by_view.iter().map(|sums| sums[line])));
    let (means, variances): (Vec<Option<f64>>, Vec<f64>) = lines.unzip();
    let coefficients = with_own_share(&means);
    let high = nodes.saturating_sub(1) as f64;
    let profile = Basis::Curve { over, low: 0.0, high, nodes, times: Modulation::One };
    (vec![Term::bias(profile, coefficients)], variances)
}

/// Of lines from which the mean over [`PIXEL_BOX`] neighbours was taken: what each had before, but for what is
/// smooth. Every second line of two read-outs has gained a seventh; two rounds leave 0.3 % of that.
fn with_own_share(means: &[Option<f64>]) -> Vec<f64> {
    const ROUNDS: usize = 2;
    let of_known = |values: &[f64], k: usize| {
        let near = k.saturating_sub(PIXEL_BOX / 2)..means.len().min(k + PIXEL_BOX / 2 + 1);
        let known = near.filter(|&j| means[j].is_some()).map(|j| values[j]);
        mean(known).unwrap_or(0.0)
    };
    let mut values: Vec<f64> = means.iter().map(|m| m.unwrap_or(0.0)).collect();
    for _ in 0..ROUNDS {
        let left = |k: usize| means[k].map_or(0.0, |m| m + of_known(&values, k));
        values = (0..means.len()).map(left).collect();
    }
    values
}

/// Mean of a line, and its variance with the views as the sample; none of too few readings.
fn of_line(views: impl Iterator<Item = (f64, f64)> + Clone) -> (Option<f64>, f64) {
    let (mut sum, mut n) = (0.0, 0.0);
    views.clone().for_each(|(s, k)| (sum, n) = (sum + s, n + k));
    if n < FEWEST_READINGS {
        return (None, 0.0);
    }
    let mean = sum / n;
    let (mut square, mut seen) = (0.0, 0.0);
    for (s, k) in views.filter(|v| v.1 > 0.0) {
        square += (s - k * mean).powi(2);
        seen += 1.0;
    }
    (Some(mean), square / (n * n) * seen / f64::max(seen - 1.0, 1.0))
}

#[cfg(test)]
#[path = "lines_tests.rs"]
mod tests;
