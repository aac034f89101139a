//! Key numbers of the sensor.

use maud::Markup;

use super::{COMPARED_AT_M, LEVEL};
use crate::measure::{SigmaTable, ViewMeasurement};
use crate::model::SigmaModel;
use crate::report::coverage::is_measured;
use crate::report::document;
use crate::report::numbers::{ABSENT, MM, fixed, millimetres, percent};
use crate::stats::median;

pub(super) fn tiles(table: &SigmaTable, sigma: &SigmaModel, views: &[ViewMeasurement]) -> Markup {
    let theta = sigma.domain.theta_rad[0];
    let names = ["σ at 1 m", "σ at 2 m", "σ at 3 m"];
    let of_sigma = names.into_iter().zip(COMPARED_AT_M).map(|(name, z)| {
        let (inside, near) = (sigma.domain.contains(z, theta), is_measured(&table.rows, z, theta));
        if !(inside && near) {
            return (name, ABSENT.to_string(), "not measured".to_string());
        }
        let [low, high] = sigma.interval(z, theta, LEVEL).map(millimetres);
        let value = format!("{} mm", millimetres(sigma.sigma(z, theta)));
        let tilt = fixed(theta.to_degrees(), 0);
        (name, value, format!("95 %: {low} to {high} mm, tilt {tilt}°"))
    });
    let more = [distance_error(views), fill_rate(views), fixed_pattern(views)];
    document::tiles(of_sigma.chain(more.into_iter().flatten()))
}

type Tile = (&'static str, String, String);

fn distance_error(views: &[ViewMeasurement]) -> Option<Tile> {
    let mut off: Vec<f64> =
        views.iter().filter_map(|v| Some(MM * v.reference()?.off_m())).collect();
    let name = "distance error";
    if off.is_empty() {
        let none = "no view has a reference distance".to_string();
        return (!views.is_empty()).then(|| (name, ABSENT.to_string(), none));
    }
    let max = off.iter().fold(0.0, |max: f64, o| if o.abs() > max.abs() { *o } else { max });
    let signed = |v: f64| format!("{}{}", if v > 0.0 { "+" } else { "" }, fixed(v, 1));
    let middle = median(&mut off);
    let remark = format!("median of {} references; largest {} mm", off.len(), signed(max));
    Some((name, format!("{} mm", signed(middle)), remark))
}

fn fill_rate(views: &[ViewMeasurement]) -> Option<Tile> {
    let mut rates: Vec<f64> = views.iter().map(|v| v.whole.fill_rate()).collect();
    let min = rates.iter().copied().fold(1.0, f64::min);
    let remark = format!("of the target's pixels have depth (median view; worst {})", percent(min));
    (!rates.is_empty()).then(|| ("fill rate", percent(median(&mut rates)), remark))
}

fn fixed_pattern(views: &[ViewMeasurement]) -> Option<Tile> {
    let mut shares: Vec<f64> = views.iter().filter_map(|v| v.whole.spread.fixed_share()).collect();
    let name = "fixed pattern";
    if shares.is_empty() {
        let one = "needs views of several frames".to_string();
        return (!views.is_empty()).then(|| (name, ABSENT.to_string(), one));
    }
    let remark = "of the variance stays from frame to frame (median view)".to_string();
    Some((name, percent(median(&mut shares)), remark))
}
