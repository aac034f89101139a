//! What a model holds beyond sigma(z, theta): terms of the bias and of the variance, as found by
//! `diagnose` and applied by `simulate`, `correct` and `map`.

mod basis;
mod coordinate;
mod edges;
mod fault;
mod gauge;
mod modulation;
mod needs;
mod pixels;
mod place;
mod properties;
mod series;
mod written;

pub use basis::{Basis, TABLE};
pub(crate) use coordinate::DARKEST;
pub use coordinate::{Coordinate, ROOM_LUX};
pub use edges::edge_distances;
pub use gauge::{Gauge, affine_parts};
pub(crate) use modulation::disparity_power;
pub use modulation::{DISPARITY_UNIT_PX, Modulation};
pub use needs::Needs;
pub use pixels::Pixels;
pub use place::{Axis, Extent, GroupMean, PixelContext, corner_radius};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What of a measurement a term changes.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Statistic {
    Bias,
    Variance,
    Distribution,
    Correlation,
    #[serde(rename = "missing")]
    Dropout,
}

/// A term with its size: added to the disparity, px, or to the logarithm of its variance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "written::Written", into = "written::Written")]
pub struct Term {
    pub statistic: Statistic,
    pub basis: Basis,
    pub coefficients: Vec<f64>,
}

impl Statistic {
    /// Name in files.
    pub fn id(self) -> &'static str {
        match self {
            Statistic::Bias => "bias",
            Statistic::Variance => "variance",
            Statistic::Distribution => "distribution",
            Statistic::Correlation => "correlation",
            Statistic::Dropout => "missing",
        }
    }
}

/// A term of a model with the range of disparities at which it was learnt, px.
pub type LearntTerm = (Term, [f64; 2]);

/// Range of a term that does not state where it was learnt.
pub const ANYWHERE: [f64; 2] = [0.0, f64::INFINITY];

/// Splits numbers written one after the other, one per coefficient, by term. With fewer numbers, the last
/// terms go without.
pub fn by_term<'a>(
    terms: &'a [Term],
    numbers: &'a [f64],
) -> impl Iterator<Item = (&'a Term, &'a [f64])> {
    let mut rest = numbers;
    terms.iter().map(move |term| {
        let (mine, others) = rest.split_at(term.basis.count().min(rest.len()));
        rest = others;
        (term, mine)
    })
}

impl Term {
    /// Bias of the disparity, px.
    pub fn bias(basis: Basis, coefficients: Vec<f64>) -> Self {
        Term { statistic: Statistic::Bias, basis, coefficients }
    }

    /// Same shape, scaled by `factor`.
    pub fn times(&self, factor: f64) -> Self {
        let coefficients = self.coefficients.iter().map(|c| factor * c).collect();
        Term { coefficients, ..self.clone() }
    }

    /// Value at a place, px or nepers of variance.
    pub fn value(&self, p: &PixelContext) -> f64 {
        self.basis.value(&self.coefficients, p)
    }

    /// Value at a place, with the disparity clamped to the range, px, in which the term was learnt if it is
    /// fixed in the picture and scales with the disparity.
    pub fn held_value(&self, learnt_px: [f64; 2], p: &PixelContext) -> f64 {
        self.value(&self.basis.held(learnt_px, p))
    }

    /// Sum of these terms at a place.
    pub fn sum(terms: &[Term], p: &PixelContext) -> f64 {
        terms.iter().map(|t| t.value(p)).sum()
    }

    /// Of the log variance of the disparity.
    pub fn variance(basis: Basis, coefficients: Vec<f64>) -> Self {
        Term { statistic: Statistic::Variance, basis, coefficients }
    }
}
