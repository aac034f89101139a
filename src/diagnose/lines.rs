//! Whole columns and rows that err by a constant each: their profile, as terms of the model.

use super::field::Field;
use super::texture::fine;
use crate::terms::{Basis, Coordinate, Modulation, Statistic, Term};

/// Columns and rows of fewer readings over all views are left at nothing.
const FEWEST_READINGS: f64 = 200.0;

/// The mean of every column and row over the views, px, without what is smooth; `bias` has what is
/// known to be no noise, by view and pixel, px.
pub fn line_terms(fields: &[Field], bias: &[Vec<f32>]) -> Vec<Term> {
    let Some(first) = fields.first() else { return Vec::new() };
    let (width, height) = (first.width, first.height);
    let none = Vec::new();
    let mut columns = vec![(0.0, 0.0); width];
    let mut rows = vec![(0.0, 0.0); height];
    for (n, field) in fields.iter().enumerate() {
        let image = fine(field, bias.get(n).unwrap_or(&none));
        for (i, &r) in image.iter().enumerate().filter(|(_, r)| r.is_finite()) {
            for line in [&mut columns[i % width], &mut rows[i / width]] {
                line.0 += f64::from(r);
                line.1 += 1.0;
            }
        }
    }
    let profile = |over, lines: &[(f64, f64)]| {
        let mean = |&(sum, n): &(f64, f64)| if n < FEWEST_READINGS { 0.0 } else { sum / n };
        let nodes = lines.len();
        let high = nodes.saturating_sub(1) as f64;
        Term {
            statistic: Statistic::Bias,
            basis: Basis::Curve { over, low: 0.0, high, nodes, times: Modulation::One },
            coefficients: lines.iter().map(mean).collect(),
        }
    };
    vec![profile(Coordinate::Column, &columns), profile(Coordinate::Row, &rows)]
}

#[cfg(test)]
#[path = "lines_tests.rs"]
mod tests;
