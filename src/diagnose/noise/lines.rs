//! Constant errors of whole columns or rows: their profile, as a term of the model.

use rayon::prelude::*;

use super::texture::{PIXEL_BOX, line_sums, pixel_scale};
use crate::diagnose::diagnosis::{Finding, Size};
use crate::diagnose::finding::parameters::one;
use crate::diagnose::views::box_sums::{SMOOTH_PX, over_boxes};
use crate::diagnose::views::field::Field;
use crate::stats::mean;
use crate::terms::{Axis, Basis, Coordinate, Modulation, Term};

/// Columns and rows with fewer readings over all views get zero.
const MIN_READINGS: f64 = 200.0;

/// Constant error of each column, or of each row.
#[derive(Debug, Clone)]
pub struct LearntLines {
    pub axis: Axis,
    pub profile: Term,
    /// Variance of each coefficient, px^2; zero for a line that was not seen.
    variances: Vec<f64>,
    /// Effective number of pixels averaged in each line, for errors that are the same in every view.
    pixels: Vec<f64>,
}

impl LearntLines {
    /// Mean of every column, or of every row, over the views, px, without what is smooth. Each view comes
    /// with its known bias, px by pixel.
    pub fn of(views: &[(&Field, &[f32])], axis: Axis) -> Option<Self> {
        let (width, height) = views.first().map(|(f, _)| (f.width, f.height))?;
        let (over, nodes) = match axis {
            Axis::Row => (Coordinate::Row, height),
            _ => (Coordinate::Column, width),
        };
        let by_view: Vec<Vec<(f64, f64)>> = views
            .par_iter()
            .map(|(field, bias)| {
                let sums = line_sums(&pixel_scale(field, &field.mean, bias), width, axis);
                // Corrected view by view, so that the scatter of the views is that of the reported profile.
                let means: Vec<f32> = sums.iter().map(|(sum, n)| (sum / n) as f32).collect();
                let own = with_own_share(&means).into_iter().map(f64::from).zip(sums);
                own.map(|(own, (_, n))| if n > 0.0 { (own * n, n) } else { (0.0, 0.0) }).collect()
            })
            .collect();
        let lines = (0..nodes).map(|line| of_line(by_view.iter().map(|sums| sums[line])));
        let (means, variances): (Vec<f64>, Vec<f64>) = lines.unzip();
        let high = nodes.saturating_sub(1) as f64;
        let basis = Basis::Curve { over, low: 0.0, high, nodes, times: Modulation::One };
        let pixels = pixels_of_lines(views, width, nodes, axis);
        Some(LearntLines { axis, profile: Term::bias(basis, means), variances, pixels })
    }

    /// Writes the profile into the finding and scales the finding to it: the test looks at the change from
    /// one line to the next, which is larger for two read-outs than for columns with independent errors. A
    /// pattern of pixels, of `pattern_px2`, has means of its own in each line.
    pub fn tell(&self, found: &mut Finding, pattern_px2: f64) {
        let LearntLines { profile, variances, pixels, .. } = self;
        let by_chance = variances.iter().zip(pixels).map(|(v, n)| (v, pattern_px2 / n.max(1.0)));
        let known = || profile.coefficients.iter().zip(by_chance.clone()).filter(|l| *l.1.0 > 0.0);
        let n = known().count() as f64;
        let variance = mean(known().map(|(_, (v, of_pattern))| v + of_pattern)).unwrap_or(0.0);
        let px2 = mean(known().map(|(c, (v, of_pattern))| c * c - v - of_pattern)).unwrap_or(0.0);
        if let Some(told) = found.value("sigma_px").filter(|told| px2 > 0.0 && *told > 0.0) {
            let sigma_px = px2.sqrt();
            let error = (variance / n * (1.0 + 0.5 * variance / px2)).sqrt();
            let times = sigma_px / told;
            found.parameters = one("sigma_px", sigma_px, error);
            found.size = Size { mm: times * found.size.mm, sigma: times * found.size.sigma };
        }
        found.interval = [0.0, variances.len().saturating_sub(1) as f64];
        (found.terms, found.covariance.variances) = (vec![profile.clone()], variances.clone());
    }
}

/// Restores lines from which means over boxes of neighbours were subtracted, as by [`pixel_scale`], except
/// for what is smooth; NaN for a line that was not seen. A line is part of the mean it lost: an alternating
/// pattern is left an eighth too large, and a thousandth after these rounds; at the borders, where boxes are
/// short, a twentieth (simulated).
fn with_own_share(means: &[f32]) -> Vec<f32> {
    const ROUNDS: usize = 3;
    let beside_box = |values: &[f32], side: usize| {
        let mut left = vec![f32::NAN; values.len()];
        over_boxes(values, values.len(), side / 2, |k, sum, n| {
            left[k] = values[k] - (sum / n) as f32;
        });
        left
    };
    let mut values = means.to_vec();
    for _ in 0..ROUNDS {
        let passed = beside_box(&beside_box(&values, SMOOTH_PX), PIXEL_BOX);
        let lines = values.iter_mut().zip(passed).zip(means);
        lines.for_each(|((value, passed), m)| *value += m - passed);
    }
    values
}

/// Effective number of pixels averaged in each line; pixels seen in few views count less.
fn pixels_of_lines(views: &[(&Field, &[f32])], width: usize, lines: usize, axis: Axis) -> Vec<f64> {
    let mut seen: Vec<f32> = Vec::new();
    for (field, _) in views {
        let image = field.image(&field.mean);
        seen.resize(seen.len().max(image.len()), 0.0);
        seen.iter_mut().zip(image).for_each(|(n, r)| *n += f32::from(r.is_finite()));
    }
    let squares: Vec<f32> = seen.iter().map(|n| n * n).collect();
    let [sums, squares] = [seen, squares].map(|image| line_sums(&image, width, axis));
    let of = |((sum, _), (square, _)): (&(f64, f64), &(f64, f64))| sum * sum / square.max(1.0);
    sums.iter().zip(&squares).map(of).take(lines).collect()
}

/// Mean of a line, and its variance with the views as the sample (HC2: MacKinnon and White 1985); zero with too
/// few readings, or in a single view.
fn of_line(views: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let (mut sum, mut n) = (0.0, 0.0);
    views.clone().for_each(|(s, k)| (sum, n) = (sum + s, n + k));
    if n < MIN_READINGS {
        return (0.0, 0.0);
    }
    let mean = sum / n;
    let mut square = 0.0;
    for (s, k) in views.filter(|v| v.1 > 0.0) {
        if k >= n {
            return (0.0, 0.0);
        }
        square += (s - k * mean).powi(2) / (1.0 - k / n);
    }
    (mean, square / (n * n))
}

#[cfg(test)]
#[path = "lines_tests.rs"]
mod tests;
