//! Finds which form of sigma(z, theta) the measured noise follows where the model's own does not fit.

use crate::diagnose::views::layers::Survey;
use crate::measure::{SigmaRow, SigmaTable};
use crate::model::{Direction, Form, HeldOut, SigmaModel, compare_forms};

/// Depth bins per view; a tilted view spans several.
const BINS: usize = 3;
/// Mean squared error, in units of a form's own predicted variance, beyond which the form is no match
/// either: twice its predicted standard error.
const NO_MATCH: f64 = 4.0;

/// Name of the form that best predicts the noise of left-out distances; `None` where that is the model's
/// own, or where the views are too few to judge.
pub fn better_form(survey: &Survey, model: &SigmaModel, scale_px_m: f64) -> Option<String> {
    let axial = table(survey, scale_px_m);
    let across = SigmaTable { rows: axial.rows.iter().map(|r| across_plane(*r)).collect() };
    let judged = |table: &SigmaTable, direction| {
        let of = move |h: HeldOut| (h, direction);
        compare_forms(table).into_iter().map(of).collect::<Vec<_>>()
    };
    let mut all = judged(&axial, Direction::Axial);
    all.extend(judged(&across, Direction::Perpendicular));
    all.sort_by(|a, b| b.0.log_score.total_cmp(&a.0.log_score));
    let (best, direction) = all.first()?;
    if best.chi2 > NO_MATCH {
        return Some("a free surface over depth and tilt: no form that is known here".into());
    }
    let own = (best.form, *direction) == (model.form, model.direction);
    (!own).then(|| words(best.form, *direction))
}

fn across_plane(row: SigmaRow) -> SigmaRow {
    SigmaRow { sigma_m: row.sigma_m * row.theta_rad.cos(), ..row }
}

fn words(form: Form, direction: Direction) -> String {
    let formula = match form {
        Form::Paper => "the paper's Eq. 1",
        Form::Nguyen => "Nguyen's",
        Form::Khoshelham => "pure z^2",
        Form::Disparity => "constant disparity noise over a floor",
    };
    let along = match direction {
        Direction::Axial => "along the optical axis",
        Direction::Perpendicular => "across the plane",
    };
    format!("{formula}, {along}")
}

/// The measured noise as a table of sigmas, m along the optical axis.
fn table(survey: &Survey, scale_px_m: f64) -> SigmaTable {
    let mut rows = Vec::new();
    for (view, data) in survey.variance_data().iter().enumerate() {
        let mut order: Vec<usize> =
            (0..data.places.len()).filter(|&i| data.weight[i] > 0.0).collect();
        order.sort_by(|&a, &b| data.places[a].z.total_cmp(&data.places[b].z));
        for bin in order.chunks(order.len().div_ceil(BINS).max(1)) {
            let weight: f64 = bin.iter().map(|&i| data.weight[i]).sum();
            let mean = |of: &dyn Fn(usize) -> f64| {
                bin.iter().map(|&i| data.weight[i] * of(i)).sum::<f64>() / weight
            };
            let z_m = mean(&|i| data.places[i].z);
            // In units of z^2, which changes most over a bin.
            let log = mean(&|i| 0.5 * (data.response[i] + data.places[i].variance.ln()));
            rows.push(SigmaRow {
                z_m,
                theta_rad: data.places[bin[0]].theta,
                sigma_m: log.exp() * z_m * z_m / scale_px_m,
                // The variance of the log is 1 / weight; for a variance of n samples it is 2 / n.
                n_effective: Some(2.0 * weight),
                view,
            });
        }
    }
    SigmaTable { rows }
}
