//! Means of the views whose standard errors are moderated by those that the noise of the pixels implies
//! (Smyth 2004).
//!
//! A dozen views give the scatter of a statistic with a dozen degrees of freedom, and Student's t pays for it.
//! For correlations and mean products the noise implies each view's error. How far views follow it shows in
//! several statistics together: their scatters over the implied ones are taken as scaled F values.

use statrs::function::gamma::digamma;

use super::expected_window;
use super::lagged::{later, of_any_two};
use super::structure::Structure;
use super::view_mean::{ViewMean, variance_px2};
use crate::diagnose::views::known::KnownTerms;
use crate::stats::{bisect, mean};

/// A statistic of a view, and its standard error by the noise of the pixels.
type Implied = fn(&Structure) -> Option<[f64; 2]>;

pub fn near(s: &Structure) -> Option<[f64; 2]> {
    Some([s.neighbour_correlation?, s.near_error])
}

/// Correlation of successive frames.
pub fn next(s: &Structure) -> Option<[f64; 2]> {
    Some([s.lagged[0]?, s.lagged_error(pairs(s, 1))])
}

/// Correlation of frames further apart.
fn further(s: &Structure) -> Option<[f64; 2]> {
    Some([later(s)?, s.lagged_error(pairs(s, 2) + pairs(s, 3))])
}

/// By how much the first exceeds the second.
pub fn falling(s: &Structure) -> Option<[f64; 2]> {
    let ([near, near_error], [far, far_error]) = (next(s)?, further(s)?);
    Some([near - far, near_error.hypot(far_error)])
}

/// Correlation of frames as far apart as there are.
pub fn last(s: &Structure) -> Option<[f64; 2]> {
    Some([s.lagged[2].or(s.lagged[1])?, s.lagged_error(1.0)])
}

pub fn any_two(s: &Structure) -> Option<[f64; 2]> {
    Some([of_any_two(s)?, s.lagged_error((1..=3).map(|lag| pairs(s, lag)).sum())])
}

fn of_lines(s: &Structure, axis: usize) -> Option<[f64; 2]> {
    Some([[s.row_px2, s.column_px2][axis]?, s.line_error(axis) * s.variance_px2])
}

/// Pairs of frames this far apart: of four frames, three, two and one.
fn pairs(s: &Structure, lag: usize) -> f64 {
    let lags = s.lagged.iter().flatten().count();
    (lags + 1).saturating_sub(lag) as f64
}

/// Means over the views, with moderated errors.
pub struct Moderated<'a> {
    pub views: &'a [Structure],
    prior: Option<Prior>,
}

impl<'a> Moderated<'a> {
    pub fn of(views: &'a [Structure], known: &KnownTerms) -> Self {
        let mut all: Vec<Implied> = vec![|s| of_lines(s, 0), |s| of_lines(s, 1), next, further];
        // Through a window, neighbours scatter by more than those of white noise.
        all.extend((expected_window(known) == 1.0).then_some(near as Implied));
        let ratios: Vec<[f64; 2]> = all.iter().filter_map(|of| scatter(views, *of)).collect();
        Moderated { views, prior: Prior::of(&ratios) }
    }

    /// Means with the errors of the views' scatter alone.
    pub fn by_scatter(views: &'a [Structure]) -> Self {
        Moderated { views, prior: None }
    }

    pub fn mean(&self, of: Implied) -> Option<ViewMean> {
        self.weighed(of, |s| s.pixels)
    }

    /// Mean of the variance common to rows (columns: 1), px^2. Views are weighted by their standard error, as
    /// the number of pairs in a line grows with its length squared.
    pub fn mean_of_lines(&self, axis: usize) -> Option<ViewMean> {
        let variance = variance_px2(self.views);
        self.weighed(|s| of_lines(s, axis), |s| s.line_size(axis, variance))
    }

    fn weighed(
        &self,
        of: impl Fn(&Structure) -> Option<[f64; 2]>,
        size: impl Fn(&Structure) -> f64,
    ) -> Option<ViewMean> {
        let known = self.views.iter().filter_map(|s| Some((of(s)?, size(s))));
        let (values, errors): (Vec<(f64, f64)>, Vec<f64>) = known
            .filter(|([value, _], _)| value.is_finite())
            .map(|([value, error], size)| ((value, size), error))
            .unzip();
        let m = ViewMean::weighed(&values)?;
        let implied = ViewMean::implied(&values, &errors);
        let prior = self.prior.filter(|_| implied.is_finite());
        Some(prior.map_or(m, |prior| prior.moderate(m, implied)))
    }
}

/// Scatter expected of a statistic: `factor` times the variance that the noise implies, worth so many
/// degrees of freedom.
#[derive(Debug, Clone, Copy)]
struct Prior {
    factor: f64,
    freedom: f64,
}

impl Prior {
    /// Fits the ratios, each with its degrees of freedom, by their logarithms' mean and variance.
    fn of(ratios: &[[f64; 2]]) -> Option<Self> {
        let n = ratios.len() as f64;
        // Mean of ln(chi squared / freedom).
        let bias = |freedom: f64| digamma(0.5 * freedom) - (0.5 * freedom).ln();
        let logs: Vec<f64> = ratios.iter().map(|[r, freedom]| r.ln() - bias(*freedom)).collect();
        let level = mean(logs.iter().copied()).filter(|_| n >= 3.0)?;
        let variance = logs.iter().map(|l| (l - level).powi(2)).sum::<f64>() / (n - 1.0);
        let by_chance = mean(ratios.iter().map(|r| trigamma(0.5 * r[1])))?;
        let total: f64 = ratios.iter().map(|r| r[1]).sum();
        // No more than the degrees of freedom that the others show it with.
        let others = total * (n - 1.0) / n;
        let freedom = (2.0 * inverse_trigamma(variance - by_chance)).min(others);
        // Views scatter by no less than their noise.
        Some(Prior { factor: (level + bias(freedom)).exp().max(1.0), freedom })
    }

    /// The mean, whose error by the noise is `implied`, with a moderated error. Four or five statistics cannot
    /// show that one of them scatters by more than the others, so its own scatter is the least.
    fn moderate(&self, m: ViewMean, implied: f64) -> ViewMean {
        let freedom = m.freedom + self.freedom;
        let own = m.std_error.powi(2);
        let prior = self.factor * implied.powi(2);
        let both = (m.freedom * own + self.freedom * prior) / freedom;
        ViewMean { std_error: both.max(own).sqrt(), freedom, ..m }
    }
}

/// Scatter of the views about their mean over the implied, and its degrees of freedom.
fn scatter(views: &[Structure], of: Implied) -> Option<[f64; 2]> {
    let values: Vec<[f64; 2]> = views
        .iter()
        .filter_map(of)
        .filter(|[value, error]| value.is_finite() && *error > 0.0 && error.is_finite())
        .collect();
    let freedom = values.len() as f64 - 1.0;
    let weights = || values.iter().map(|[_, error]| error.powi(-2));
    let sum = values.iter().zip(weights()).map(|([value, _], w)| w * value).sum::<f64>();
    let level = sum / weights().sum::<f64>();
    let square: f64 = values.iter().map(|[value, error]| ((value - level) / error).powi(2)).sum();
    (freedom >= 2.0 && square > 0.0).then(|| [square / freedom, freedom])
}

/// Second derivative of ln gamma (Abramowitz and Stegun 6.4.6, 6.4.12).
fn trigamma(x: f64) -> f64 {
    let (mut x, mut sum) = (x, 0.0);
    while x < 6.0 {
        sum += x.powi(-2);
        x += 1.0;
    }
    let r = x.powi(-2);
    sum + 1.0 / x + 0.5 * r + r / x * (1.0 / 6.0 - r * (1.0 / 30.0 - r / 42.0))
}

/// Argument at which trigamma has this value; infinite for none.
fn inverse_trigamma(value: f64) -> f64 {
    if value <= 0.0 {
        return f64::INFINITY;
    }
    // Trigamma lies between 1/x and 1/x + 1/x^2.
    bisect([1.0 / value, 1.0 / value + 1.0 / value.sqrt()], |x| trigamma(x) > value)[0]
}

#[cfg(test)]
#[path = "moderated_tests.rs"]
mod tests;
