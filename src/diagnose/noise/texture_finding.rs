//! A mismatch of the noise's structure.

use serde_json::Map;

use super::view_mean::{ViewMean, nats};
use crate::diagnose::diagnosis::in_some_views;
use crate::diagnose::finding::parameters::one;
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
    /// So many views have it, of so many, as the words tell; `None` of what all have.
    pub of_some: Option<[usize; 2]>,
}

impl TextureFinding {
    /// What these views showed when they were taken for all, of so many that were measured.
    pub fn of_some(self, [shown, of]: [usize; 2], p: f64) -> Self {
        let which = in_some_views([shown, of]);
        let words = Some(self.words.map_or(which.clone(), |words| format!("{words}, {which}")));
        TextureFinding { words, of_some: Some([shown, of]), p, ..self }
    }

    /// Tails too weak to count, which the fourth moment alone tells.
    pub fn are_weak_tails(&self) -> bool {
        self.parameters.contains_key(EXCESS)
    }

    /// Of tails: do all views have errors far out?
    pub fn are_far_errors(&self) -> bool {
        self.of_some.is_none() && !self.are_weak_tails()
    }

    /// Columns or rows that stand still, without a name.
    pub fn are_still_lines(&self) -> bool {
        let of_lines = matches!(self.axis, Axis::Column | Axis::Row);
        self.families.is_empty() && self.statistic == Statistic::Bias && of_lines
    }

    /// With these names, and nothing else said yet.
    pub fn named(families: Vec<&'static str>, statistic: Statistic, axis: Axis) -> Self {
        TextureFinding {
            families,
            statistic,
            axis,
            interval: [0.0, 0.0],
            parameters: Map::new(),
            size_sigma: 0.0,
            p: 1.0,
            nats: 0.0,
            words: None,
            of_some: None,
        }
    }
}

/// The parameter that tells tails too weak to count from far errors.
pub const EXCESS: &str = "excess_kurtosis";

/// Variance that pixels or lines share, as it is looked for.
pub struct Shared {
    pub families: Vec<&'static str>,
    pub statistic: Statistic,
    pub axis: Axis,
    /// What the model has of it, px^2.
    pub expected_px2: f64,
    /// Of all variance: a smaller share is not worth a word.
    pub min_share: f64,
    pub words: Option<&'static str>,
}

impl Shared {
    /// `m` of the noise's `variance_px2`, both px^2.
    pub fn found(self, m: &ViewMean, variance_px2: f64, level: f64) -> Option<TextureFinding> {
        let p = m.p_above(self.expected_px2);
        let share = (m.value - self.expected_px2) / variance_px2.max(1e-12);
        let sigma = m.value.max(0.0).sqrt();
        (p < level && share > self.min_share).then(|| TextureFinding {
            parameters: one("sigma_px", sigma, 0.5 * m.std_error / sigma.max(1e-9)),
            size_sigma: share.sqrt(),
            p,
            nats: nats(m, self.expected_px2),
            words: self.words.map(String::from),
            ..TextureFinding::named(self.families, self.statistic, self.axis)
        })
    }
}
