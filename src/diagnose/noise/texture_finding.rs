//! A mismatch of the noise's structure.

use serde_json::Map;

use super::view_mean::{ViewMean, nats};
use crate::diagnose::diagnosis::in_some_views;
use crate::diagnose::finding::parameters::one;
use crate::terms::{Axis, Statistic};

/// A mismatch of the noise's structure.
#[derive(Debug, Clone)]
pub struct TextureFinding {
    /// Best first; several when they cannot be told apart. Empty: no name.
    pub families: Vec<&'static str>,
    pub statistic: Statistic,
    pub axis: Axis,
    pub interval: [f64; 2],
    pub parameters: Map<String, serde_json::Value>,
    /// In units of the noise's standard deviation.
    pub size_sigma: f64,
    pub p: f64,
    /// Approximate evidence, nats per recording.
    pub nats: f64,
    pub words: Option<String>,
    /// Number of views that show it, and of views measured, as the words say; `None` if all do.
    pub of_some: Option<[usize; 2]>,
}

impl TextureFinding {
    /// Marks what these views showed by themselves as a finding of some of the views measured.
    pub fn of_some(self, [shown, of]: [usize; 2], p: f64) -> Self {
        let which = in_some_views([shown, of]);
        let words = Some(self.words.map_or(which.clone(), |words| format!("{words}, {which}")));
        TextureFinding { words, of_some: Some([shown, of]), p, ..self }
    }

    /// Whether these are tails too weak to count, shown by the fourth moment alone.
    pub fn are_weak_tails(&self) -> bool {
        self.parameters.contains_key(EXCESS)
    }

    /// For tails: whether all views have errors far out.
    pub fn are_far_errors(&self) -> bool {
        self.of_some.is_none() && !self.are_weak_tails()
    }

    /// Whether these are constant errors of columns or rows, without a name.
    pub fn are_still_lines(&self) -> bool {
        let of_lines = matches!(self.axis, Axis::Column | Axis::Row);
        self.families.is_empty() && self.statistic == Statistic::Bias && of_lines
    }

    /// A finding with these names and nothing else set.
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

    /// Fills in variance that pixels or lines share: the mean `m` of the views, where it is above the
    /// `expected_px2` of the model; `variance_px2` is that of the noise.
    pub fn shared(
        self,
        m: &ViewMean,
        expected_px2: f64,
        variance_px2: f64,
        level: f64,
    ) -> Option<Self> {
        let p = m.p_above(expected_px2);
        let share = (m.value - expected_px2) / variance_px2.max(1e-12);
        let sigma = m.value.max(0.0).sqrt();
        (p < level && share > 0.0).then(|| TextureFinding {
            parameters: one("sigma_px", sigma, 0.5 * m.std_error / sigma.max(1e-9)),
            size_sigma: share.sqrt(),
            p,
            nats: nats(m, expected_px2),
            ..self
        })
    }
}

/// Parameter that marks weak tails; far errors do not have it.
pub const EXCESS: &str = "excess_kurtosis";
