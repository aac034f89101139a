//! Candidates for a missing term: a shape with or without the name of its cause.

use crate::diagnose::views::samples::COARSE_PX;
use crate::effects::{self, Bounds, Effect, Flat, USUAL_PX};
use crate::terms::{Axis, Basis, Coordinate, Modulation, Statistic};

/// A term to try.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Id in the catalogue; `None` for a curve without a name.
    pub family: Option<&'static str>,
    pub basis: Basis,
    /// Stated flatness of the target.
    pub flat: Option<Flat>,
}

/// Family of the sigma model's own parameters: nothing is missing, they are off.
pub const RECALIBRATE: &str = "recalibrate";

/// Number of nodes from which a curve over columns or rows is too fine for a smooth map.
const FINE_LINES: usize = 30;
/// Smallest node spacing that larger patches resolve, in patches.
const PATCHES_A_NODE: f64 = 2.0;

impl Candidate {
    pub fn named(family: &'static str, basis: Basis) -> Self {
        Candidate { family: Some(family), basis, flat: None }
    }

    pub fn curve(basis: Basis) -> Self {
        Candidate { family: None, basis, flat: None }
    }

    /// A periodic curve without a name.
    pub fn ring(over: Coordinate, period: f64, nodes: usize) -> Self {
        Candidate::curve(Basis::Ring { over, period, nodes, times: Modulation::One })
    }

    /// A step at `at` from one level to another, rising over a width of `wide`.
    pub fn step(over: Coordinate, at: f64, wide: f64) -> Self {
        let (low, high) = (at - 0.5 * wide, at + 0.5 * wide);
        Candidate::curve(Basis::Curve { over, low, high, nodes: 2, times: Modulation::One })
    }

    /// All shapes of the catalogue's effects that change `statistic` and apply to this kind of sensor.
    pub fn of_catalogue(statistic: Statistic, bounds: &Bounds) -> Vec<Self> {
        let of = |effect: &'static dyn Effect| {
            let id = effect.card().id;
            let named = move |basis| Candidate { family: Some(id), basis, flat: bounds.flat };
            effect.shapes(bounds).into_iter().map(named)
        };
        let can = |e: &&'static dyn Effect| e.card().applies_to(bounds.kind);
        effects::that_change(statistic).filter(can).flat_map(of).collect()
    }

    /// Whether it follows the disparity itself, which a time-of-flight camera does not have.
    pub fn is_of_disparity(&self) -> bool {
        let over = |over: Coordinate| over == Coordinate::Disparity;
        match self.basis {
            Basis::Curve { over: axis, .. } | Basis::Ring { over: axis, .. } => over(axis),
            _ => self.basis.axis() == Axis::DisparityPhase,
        }
    }

    /// Whether it is too rough for a smooth map to replace it, or for larger patches to show it.
    pub fn is_rough(&self) -> bool {
        let changes_within_a_patch = match self.basis {
            Basis::Curve {
                over: Coordinate::Column | Coordinate::Row, low, high, nodes, ..
            } => {
                nodes == 2
                    || nodes >= FINE_LINES
                    || high - low < PATCHES_A_NODE * COARSE_PX * nodes as f64
            }
            Basis::Curve { .. } => self.basis.alone().is_some(),
            _ => false,
        };
        self.basis.is_fine() || changes_within_a_patch || self.basis.period().is_some()
    }

    /// The effect that it is the shape of.
    pub fn effect(&self) -> Option<&'static dyn Effect> {
        effects::find(self.family?)
    }

    /// Relative error of the effect's formula; 0 for a nameless curve, which is as measured.
    pub fn formula_error(&self) -> f64 {
        self.effect().map_or(0.0, |e| e.card().formula_error)
    }

    /// See [`Effect::usual`].
    pub fn usual(&self, k: usize) -> f64 {
        self.effect().map_or(USUAL_PX, |e| e.usual(&self.basis, k, self.flat.as_ref()))
    }

    /// Whether a fit agrees with what its effect can do and with the stated flatness of the target.
    pub fn agrees(&self, coefficients: &[f64]) -> bool {
        let agrees = |e: &dyn Effect| e.agrees_with(self.flat.as_ref(), &self.basis, coefficients);
        self.effect().is_none_or(agrees)
    }
}
