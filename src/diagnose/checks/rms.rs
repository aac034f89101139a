//! RMS residuals of the views with terms subtracted, about a plane that is fitted anew.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::surveyed_view::SurveyedView;
use crate::diagnose::views::tiles::Tile;
use crate::terms::{PixelContext, Term};

/// RMS over every pixel of every frame, px, with the sum of squares reduced by `less_px2` for the lines; and
/// RMS of the smooth residual, mm.
pub fn rms(views: &[SurveyedView], terms: &[Term], scale_px_m: f64, less_px2: f64) -> [f64; 2] {
    let (mut px, mut mm, mut n) = (0.0, 0.0, 0.0);
    for view in views {
        each_patch(view, terms, |(place, t), f| {
            let to_mm = 1e3 * place.z * place.z / scale_px_m;
            // Squares of the patch's readings about `f`.
            px += t.pixels * (t.square - 2.0 * f * t.mean + f * f).max(0.0);
            mm += t.pixels * ((t.mean - f) * to_mm).powi(2);
            n += t.pixels;
        });
    }
    [((px - less_px2).max(0.0) / n).sqrt(), (mm / n).sqrt()]
}

/// Change in each view's disparity on the optical axis once the terms are subtracted, px.
pub fn levels(survey: &Survey, terms: &[Term]) -> Vec<f64> {
    let level = |v: &SurveyedView| plane_left(v, &values(v, terms)).map_or(0.0, |p| p[0]);
    survey.views.par_iter().map(level).collect()
}

fn values(view: &SurveyedView, terms: &[Term]) -> Vec<f64> {
    view.places.iter().map(|place| Term::sum(terms, place)).collect()
}

/// Plane left in a view's means without these values.
fn plane_left(view: &SurveyedView, values: &[f64]) -> Option<Vector3<f64>> {
    view.plane_through(view.tiles.iter().zip(values).map(|(t, f)| t.mean - f))
}

/// Visits every patch that has a mean, with the terms' value there, the plane fitted anew.
fn each_patch(
    view: &SurveyedView,
    terms: &[Term],
    mut visit: impl FnMut((&PixelContext, &Tile), f64),
) {
    let values = values(view, terms);
    // What the terms leave has a plane of its own, which is subtracted with them.
    let plane = plane_left(view, &values);
    for ((p, t), f) in view.patches().zip(values).filter(|((_, t), _)| t.mean.is_finite()) {
        let f = plane.map_or(f, |plane| f + (plane[0] + plane[1] * p.x + plane[2] * p.y));
        visit((p, t), f);
    }
}

/// RMS of each view's mean residual with the terms subtracted, px.
pub fn rms_by_view(survey: &Survey, terms: &[Term]) -> Vec<f64> {
    survey
        .views
        .iter()
        .map(|view| {
            let (mut sum, mut n) = (0.0, 0.0);
            each_patch(view, terms, |(_, t), f| {
                sum += t.pixels * (t.mean - f).powi(2);
                n += t.pixels;
            });
            (sum / f64::max(n, 1.0)).sqrt()
        })
        .collect()
}
