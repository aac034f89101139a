//! A formula, what it stands for, and which of several to keep.

use std::f64::consts::TAU;

use nalgebra::DVector;
use ndarray::Array2;
use symbolic_regression::prelude::{
    BuiltinOpsF64, EvalOptions, PNode, PostfixExpr, eval_tree_array,
};

use super::learnt::AtPlaces;
use super::polynomial::Frame;
use crate::terms::PixelContext;

/// Two operands at most.
pub(super) const ARITY: usize = 2;

pub(super) type Formula = PostfixExpr<f64, BuiltinOpsF64, ARITY>;

/// What formulas are made of, in order.
pub(super) const NAMES: [&str; FEATURES] = ["u", "v", "d", "r", "theta", "phase"];
const FEATURES: usize = 6;
const COLUMN: u16 = 0;
const ROW: u16 = 1;
const DISPARITY: u16 = 2;
const RADIUS: u16 = 3;
const TILT: u16 = 4;
const PHASE: u16 = 5;

pub(super) fn features(frame: &Frame, places: &[PixelContext]) -> Array2<f64> {
    let one = |p: &PixelContext| {
        let [u, v, d] = frame.of_place(p);
        [u, v, d, p.radius, p.theta, TAU * p.disparity]
    };
    let rows: Vec<[f64; FEATURES]> = places.iter().map(one).collect();
    Array2::from_shape_fn((FEATURES, rows.len()), |(k, i)| rows[i][k])
}

pub(super) fn value(formula: &Formula, x: &Array2<f64>) -> Vec<f64> {
    let options = EvalOptions { check_finite: false, early_exit: false };
    eval_tree_array::<f64, BuiltinOpsF64, ARITY>(formula, x.view(), &options).0
}

/// The formula to keep, times a factor; none where none is worth its length.
pub(super) struct Kept {
    pub formula: Formula,
    pub factor: f64,
}

impl Kept {
    /// Leaves: a constant is one number, and so is the choice of a variable.
    pub fn parameters(&self) -> usize {
        self.formula.nodes.iter().filter(|n| !matches!(n, PNode::Op { .. })).count()
    }

    fn has(&self, feature: u16) -> bool {
        self.formula.nodes.contains(&PNode::Var { feature })
    }

    fn has_sine(&self) -> bool {
        self.formula.nodes.iter().any(|n| matches!(n, PNode::Op { arity: 1, .. }))
    }

    fn is_radial(&self) -> bool {
        self.has(RADIUS) || self.has(COLUMN) && self.has(ROW)
    }

    pub fn cause_of_bias(&self) -> Option<&'static str> {
        if self.has_sine() && (self.has(PHASE) || self.has(DISPARITY)) {
            Some("pixel-locking")
        } else if self.has_sine() && self.has(COLUMN) && !self.has(ROW) && !self.has(RADIUS) {
            Some("column-banding")
        } else if self.has(TILT) {
            Some("lens-distortion")
        } else if self.is_radial() {
            Some("radial-disparity-bias")
        } else {
            None
        }
    }

    pub fn cause_of_variance(&self) -> Option<&'static str> {
        let any = (0..FEATURES as u16).any(|f| self.has(f));
        if self.has(TILT) {
            Some("slope-noise")
        } else if self.is_radial() {
            Some("vignetting")
        } else if self.has(DISPARITY) && !self.has(COLUMN) && !self.has(ROW) {
            Some("range-exponent")
        } else if !any {
            Some("recalibrate")
        } else {
            None
        }
    }

    pub fn at_places(self, frame: Frame) -> AtPlaces {
        Box::new(move |places| {
            let mut values = value(&self.formula, &features(&frame, places));
            values.iter_mut().for_each(|v| *v *= self.factor);
            values
        })
    }
}

/// The least BIC. `column` makes of a formula's values what is compared with `target`, both over
/// standard errors.
pub(super) fn keep(
    formulas: Vec<Formula>,
    x: &Array2<f64>,
    target: &DVector<f64>,
    column: &dyn Fn(&[f64]) -> DVector<f64>,
    log_n: f64,
) -> Option<Kept> {
    let mut best: Option<(f64, Kept)> = None;
    for formula in formulas {
        let g = column(&value(&formula, x));
        let size = g.norm_squared();
        let factor = g.dot(target) / size;
        if !(size > 0.0 && factor.is_finite()) {
            continue;
        }
        let kept = Kept { formula, factor };
        let worth = factor * g.dot(target) - log_n * kept.parameters() as f64;
        if worth > best.as_ref().map_or(0.0, |b| b.0) {
            best = Some((worth, kept));
        }
    }
    best.map(|(_, kept)| kept)
}
