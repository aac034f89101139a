//! Judges forms on held-out distances.

use super::fit::{DISTANCE_RATIO, fit_all};
use super::forms::Form;
use super::rows::Rows;
use crate::measure::SigmaTable;

/// Prediction quality of a form at distances left out of its fit, over all distances.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOut {
    pub form: Form,
    /// Mean log density of the relative residual, nats per view; greater is better.
    pub log_score: f64,
    /// Root mean square relative error, with equal weights for all views.
    pub rmse_relative: f64,
    /// Mean squared error over the predicted variance; one where the form's uncertainty is right.
    pub chi2: f64,
    /// Number of groups of distances left out in turn.
    pub folds: usize,
}

/// More distances than this are merged into as many groups.
const MAX_FOLDS: usize = 8;

/// Leaves out one distance (or group of neighbouring distances) at a time; views stay whole. Every row
/// counts, so remove outliers first ([`super::sort_out`]) for a fair comparison of forms.
///
/// `None` when there are fewer than three distances or a fold cannot be fitted.
fn held_out(table: &SigmaTable, form: Form) -> Option<HeldOut> {
    let folds = folds(table);
    let count = folds.iter().map(|(_, fold)| fold + 1).max()?;
    let fold_of = |view: usize| folds.iter().find(|(v, _)| *v == view).map_or(0, |(_, f)| *f);
    let (mut score, mut square, mut chi2, mut views) = (0.0, 0.0, 0.0, 0.0);
    for left_out in 0..count {
        let pick = |keep: bool| SigmaTable {
            rows: table
                .rows
                .iter()
                .filter(|r| (fold_of(r.view) != left_out) == keep)
                .copied()
                .collect(),
        };
        let (train, test) = (pick(true), pick(false));
        let fitted = fit_all(&train, form).ok()?;
        let surface = fitted.model();
        let p = fitted.values();
        let extra = fitted.extra_within.powi(2) + fitted.extra_between.powi(2);
        let rows = Rows::new(&test);
        for view in test.views() {
            let (mut s, mut q, mut c, mut n) = (0.0, 0.0, 0.0, 0.0);
            for (i, r) in rows.iter().enumerate().filter(|(_, r)| r.view == view) {
                let predicted = form.spec().sigma(&p, r.z_m, r.theta_rad);
                let error = r.sigma_m / predicted - 1.0;
                let variance = if rows.counted() {
                    rows.relative_variance(i) + extra
                } else {
                    fitted.relative_variance()
                }
                .max(f64::MIN_POSITIVE)
                    // The surface's own uncertainty at a distance it has not seen counts too.
                    + (surface.std_error(r.z_m, r.theta_rad) / predicted).powi(2);
                s += -0.5
                    * (error * error / variance + (2.0 * std::f64::consts::PI * variance).ln());
                q += error * error;
                c += error * error / variance;
                n += 1.0;
            }
            score += s / n;
            square += q / n;
            chi2 += c / n;
            views += 1.0;
        }
    }
    let result = HeldOut {
        form,
        log_score: score / views,
        rmse_relative: (square / views).sqrt(),
        chi2: chi2 / views,
        folds: count,
    };
    (result.log_score.is_finite() && result.rmse_relative.is_finite()).then_some(result)
}

/// Scores of all forms that can be judged, best first, on the same rows.
pub fn compare_forms(table: &SigmaTable) -> Vec<HeldOut> {
    let mut scores: Vec<HeldOut> =
        Form::ALL.into_iter().filter_map(|f| held_out(table, f)).collect();
    scores.sort_by(|a, b| b.log_score.total_cmp(&a.log_score));
    scores
}

/// Each view with its fold, by mean distance; empty with fewer than three distances.
fn folds(table: &SigmaTable) -> Vec<(usize, usize)> {
    let mut views: Vec<(usize, f64)> = table
        .views()
        .into_iter()
        .map(|view| {
            let z: Vec<f64> = table.rows.iter().filter(|r| r.view == view).map(|r| r.z_m).collect();
            (view, z.iter().sum::<f64>() / z.len() as f64)
        })
        .collect();
    views.sort_by(|a, b| a.1.total_cmp(&b.1));
    // A distance is all that lies within the ratio of its nearest view.
    let (mut nearest, mut distances) = (0.0, Vec::<Vec<usize>>::new());
    for (view, z) in views {
        if z > nearest * DISTANCE_RATIO {
            nearest = z;
            distances.push(Vec::new());
        }
        distances.last_mut().into_iter().for_each(|d| d.push(view));
    }
    // Of more distances, those share a fold whose middle views lie in one of as many equal parts.
    let total: usize = distances.iter().map(Vec::len).sum();
    let mut before = 0;
    let middles = distances.iter().map(|d| {
        before += d.len();
        (2 * before - d.len()) * MAX_FOLDS / (2 * total)
    });
    let mut parts: Vec<usize> = middles.collect();
    let different = |parts: &[usize]| {
        let mut parts = parts.to_vec();
        parts.dedup();
        parts
    };
    // Few remain where most views are of one distance.
    if distances.len() <= MAX_FOLDS || different(&parts).len() < 3 {
        let count = MAX_FOLDS.min(distances.len());
        parts = (0..distances.len()).map(|k| k * count / distances.len()).collect();
    }
    let folds = different(&parts);
    if folds.len() < 3 {
        return Vec::new();
    }
    let of = |(views, part): (Vec<usize>, usize)| {
        let fold = folds.partition_point(|p| *p < part);
        views.into_iter().map(move |view| (view, fold))
    };
    distances.into_iter().zip(parts).flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::SigmaRow;

    /// `tilts` views at each of `distances` distances.
    fn table(distances: usize, tilts: usize) -> SigmaTable {
        let row = |view: usize| SigmaRow {
            z_m: 1.0 + 0.5 * (view / tilts) as f64,
            theta_rad: 0.1 * (view % tilts) as f64,
            sigma_m: 0.01,
            n_effective: None,
            view,
        };
        SigmaTable { rows: (0..distances * tilts).map(row).collect() }
    }

    #[test]
    fn a_distance_is_left_out_whole() {
        for (distances, expected) in [(3, 3), (8, 8), (9, 8), (13, 8)] {
            let folds = folds(&table(distances, 7));
            for views in folds.chunks(7) {
                assert!(views.iter().all(|(_, fold)| *fold == views[0].1), "{views:?}");
            }
            assert_eq!(folds.iter().map(|f| f.1).max(), Some(expected - 1));
        }
        assert!(folds(&table(2, 7)).is_empty() && held_out(&table(2, 7), Form::Paper).is_none());
    }

    /// Steps of 5 cm from 0.5 to 4 m are, beyond 1 m, within the ratio of one another.
    #[test]
    fn close_distances_are_parted() {
        let mut close = table(71, 1);
        close.rows.iter_mut().for_each(|r| r.z_m = 0.5 + 0.05 * r.view as f64);
        let folds = folds(&close);
        let sizes: Vec<usize> =
            (0..MAX_FOLDS).map(|k| folds.iter().filter(|f| f.1 == k).count()).collect();
        assert!(sizes.iter().all(|n| (5..=13).contains(n)), "{sizes:?}");
        // 56 views of the nearest of nine distances.
        let mut uneven = table(64, 1);
        uneven.rows.iter_mut().for_each(|r| r.z_m = 1.0 + 0.5 * r.view.saturating_sub(55) as f64);
        assert_eq!(super::folds(&uneven).iter().map(|f| f.1).max(), Some(MAX_FOLDS - 1));
    }
}
