//! Detects a recording far from the model, even if no search found what its views have in common.

use super::rms::rms_by_view;
use crate::diagnose::diagnosis::{Finding, Size};
use crate::diagnose::finding::other_findings::nameless;
use crate::diagnose::views::field::CLIP_SIGMAS;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::samples::ViewData;
use crate::terms::{Axis, Statistic};

/// At least two views, and a quarter of all: a single one may show something else.
const MIN_VIEWS: usize = 2;
const SHARE: usize = 4;

/// Finds a recording whose mean residuals, or whose noise over the model's, are beyond the clip in a quarter
/// of the views. Such residuals are no noise, and such noise is another sensor's: a mismatch, whatever its
/// cause. A search needs views that agree, and few views never do for sure.
pub fn far_off(survey: &Survey, sigma_mm: f64) -> Option<Finding> {
    let limit = f64::from(CLIP_SIGMAS);
    let sigma_px = survey.views.iter().map(|view| {
        let pixels: f64 = view.tiles.iter().map(|t| t.pixels).sum();
        let square: f64 = view.tiles.iter().map(|t| t.pixels * t.variance).sum();
        (square / pixels.max(1.0)).sqrt()
    });
    let rms_px = rms_by_view(survey, &[]);
    let sigma = reached(rms_px.iter().zip(sigma_px).map(|(rms, sigma)| rms / sigma).collect());
    let found = |sigma: f64, words: String, statistic| Finding {
        share: 1.0,
        size: Size { mm: sigma * sigma_mm, sigma },
        physics: format!(
            "{words}, and these views do not say by what: the model may be another sensor's, or views from more \
             distances and tilts may tell."
        ),
        ..nameless(statistic, Axis::Pixel)
    };
    if let Some(sigma) = sigma.filter(|s| *s > limit) {
        let words = format!("The views' mean errors are {sigma:.0} times the noise of a pixel");
        return Some(found(sigma, words, Statistic::Bias));
    }
    // Ratio of a view's noise to the model's.
    let factor = |view: &ViewData| Some((0.5 * view.level()?.0).exp());
    let factors: Vec<f64> = survey.variance_data().iter().filter_map(factor).collect();
    let larger = reached(factors.clone()).filter(|f| *f > limit);
    let smaller = reached(factors.iter().map(|f| 1.0 / f).collect()).filter(|f| *f > limit);
    let (words, sigma) = match (larger, smaller) {
        (Some(factor), _) => (format!("{factor:.0} times as large as"), factor - 1.0),
        (None, Some(factor)) => (format!("{factor:.0} times smaller than"), 1.0 - 1.0 / factor),
        (None, None) => return None,
    };
    let words = format!("In some views the noise is {words} the model's");
    Some(found(sigma, words, Statistic::Variance))
}

/// Value that at least two of the views, and a quarter of them, reach.
fn reached(mut of_views: Vec<f64>) -> Option<f64> {
    of_views.retain(|x| x.is_finite());
    of_views.sort_by(|a, b| b.total_cmp(a));
    of_views.get(of_views.len().div_ceil(SHARE).max(MIN_VIEWS) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_of_the_views_are_beyond() {
        assert_eq!(reached(vec![9.0, 1.0, 1.0, 1.0]), Some(1.0));
        assert_eq!(reached(vec![9.0, 1.0, f64::NAN, 8.0, 1.0]), Some(8.0));
        assert_eq!(reached((1..=12).map(f64::from).collect()), Some(10.0));
        assert_eq!(reached(vec![9.0]), None);
    }
}
