//! A mismatch of the noise's structure, and the views' mean that shows it.

use serde_json::Map;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::null::student;
use super::parameters::estimate;
use super::structure::Structure;
use super::verdict::MIN_SIZE;
use crate::terms::{Axis, Statistic};

/// A mismatch of the noise's structure.
#[derive(Debug, Clone)]
pub struct TextureFinding {
    /// Best first; more than one when they cannot be told apart. Empty: no name.
    pub families: Vec<&'static str>,
    pub statistic: Statistic,
    pub axis: Axis,
    pub interval: [f64; 2],
    pub parameters: Map<String, serde_json::Value>,
    /// In units of the noise's standard deviation.
    pub size_sigma: f64,
    pub p: f64,
    /// Roughly, nats a recording.
    pub nats: f64,
    pub words: Option<String>,
}

/// Mean of a statistic over the views, and its standard error.
#[derive(Debug, Clone, Copy)]
pub struct ViewMean {
    pub value: f64,
    pub std_error: f64,
    pub views: f64,
}

impl ViewMean {
    pub fn of(views: &[Structure], value: impl Fn(&Structure) -> Option<f64>) -> Option<Self> {
        let values: Vec<(f64, f64)> = views
            .iter()
            .filter_map(|s| Some((value(s).filter(|v| v.is_finite())?, s.pixels)))
            .collect();
        ViewMean::weighed(&values)
    }

    /// Of values, each with how much there is of what it was measured on.
    pub fn weighed(values: &[(f64, f64)]) -> Option<Self> {
        let middle = values.iter().map(|v| v.1).sum::<f64>() / values.len().max(1) as f64;
        // A small one says little; views differ for reasons of their own, so that a large one
        // does not say all.
        let weight = |size: f64| if middle > 0.0 { size / (size + middle) } else { 1.0 };
        let total: f64 = values.iter().map(|v| weight(v.1)).sum();
        let squares: f64 = values.iter().map(|v| weight(v.1).powi(2)).sum();
        let n = total * total / squares.max(f64::MIN_POSITIVE);
        if values.len() < 2 || n <= 1.0 {
            return None;
        }
        let value = values.iter().map(|v| weight(v.1) * v.0).sum::<f64>() / total;
        let scatter: f64 = values.iter().map(|v| (weight(v.1) * (v.0 - value)).powi(2)).sum();
        Some(ViewMean { value, std_error: (scatter * n / (n - 1.0)).sqrt() / total, views: n })
    }

    /// Of what each view shares with all the others: a pair of views counts in two of the values, so
    /// that these scatter less than their mean errs.
    pub fn of_pairs(
        views: &[Structure],
        value: impl Fn(&Structure) -> Option<f64>,
    ) -> Option<Self> {
        let m = ViewMean::of(views, value)?;
        let std_error = m.std_error * (2.0 * (m.views - 1.0) / (m.views - 2.0)).sqrt();
        (m.views > 2.0).then_some(ViewMean { std_error, ..m })
    }

    /// Chance of a mean this far above `expected`, one-sided, by Student's t.
    pub fn p_above(&self, expected: f64) -> f64 {
        let t = (self.value - expected) / self.std_error.max(1e-12 * self.value.abs()).max(1e-300);
        StudentsT::new(0.0, 1.0, self.views - 1.0).map_or(1.0, |d| 1.0 - d.cdf(t)).max(1e-300)
    }

    /// The same below it.
    pub fn p_below(&self, expected: f64) -> f64 {
        ViewMean { value: -self.value, ..*self }.p_above(-expected)
    }
}

pub fn one(name: &str, value: f64, std_error: f64) -> Map<String, serde_json::Value> {
    let mut map = Map::new();
    map.insert(name.into(), estimate(value, std_error));
    map
}

pub fn nats(m: &ViewMean, expected: f64) -> f64 {
    let t = (m.value - expected) / m.std_error.max(1e-9);
    student(0.5 * t * t, m.views)
}

/// Variance that pixels or lines share, as it is looked for.
pub struct Shared {
    pub families: Vec<&'static str>,
    pub statistic: Statistic,
    pub axis: Axis,
    /// What the model has of it, px^2.
    pub expected_px2: f64,
    /// Of all variance: a smaller share is not worth a word.
    pub least: f64,
    pub words: Option<&'static str>,
}

impl Shared {
    /// `m` of the noise's `variance_px2`, both px^2.
    pub fn found(self, m: &ViewMean, variance_px2: f64, level: f64) -> Option<TextureFinding> {
        let p = m.p_above(self.expected_px2);
        let share = (m.value - self.expected_px2) / variance_px2.max(1e-12);
        let sigma = m.value.max(0.0).sqrt();
        (p < level && share > self.least).then(|| TextureFinding {
            families: self.families,
            statistic: self.statistic,
            axis: self.axis,
            interval: [0.0, 0.0],
            parameters: one("sigma_px", sigma, 0.5 * m.std_error / sigma.max(1e-9)),
            size_sigma: share.sqrt(),
            p,
            nats: nats(m, self.expected_px2),
            words: self.words.map(String::from),
        })
    }
}

/// A share of the variance is not told whose square root is smaller than a bias must be.
pub const LEAST_VARIANCE_SHARE: f64 = MIN_SIZE * MIN_SIZE;

/// Of the first frame's rough residual, px^2.
pub fn variance_px2(views: &[Structure]) -> f64 {
    ViewMean::of(views, |s| Some(s.variance_px2)).map_or(0.0, |m| m.value)
}
