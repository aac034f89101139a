//! Symbolic regression: a formula for the bias and one for the log variance, by the evolution of
//! SymbolicRegression.jl (Cranmer 2023, arXiv 2305.01582) in its Rust port.
//!
//! Of the formulas that are best for their length the one with the least BIC is kept, measurements
//! taken for independent. Which cause a formula stands for was written down before any trial:
//!
//! | statistic | formula | cause |
//! |---|---|---|
//! | bias | sine, of the disparity or its phase | pixel-locking |
//! | bias | sine, of the column alone | column-banding |
//! | bias | has the tilt | lens-distortion |
//! | bias | has the radius, or column and row | radial-disparity-bias |
//! | variance | has the tilt | slope-noise |
//! | variance | has the radius, or column and row | vignetting |
//! | variance | has the disparity alone | range-exponent |
//! | variance | a number alone | recalibrate |
//! | either | anything else | no name |

use std::f64::consts::TAU;

use nalgebra::DVector;
use ndarray::{Array1, Array2};
use symbolic_regression::prelude::{BuiltinOpsF64, EvalOptions, PNode, PostfixExpr, eval_tree_array};
use symbolic_regression::{Dataset, Operators, Options, SearchEngine};

use super::learnt::{AtPlaces, Learnt};
use super::linear::{Design, ratios};
use super::polynomial::Frame;
use super::tiles::Tiles;
use super::{Baseline, Fitted};
use crate::error::{Error, Result};
use crate::terms::Place;

/// How long it searches: formulas tried, for the bias and for the variance each. A limit in time
/// would give another answer on another day.
#[derive(Debug, Clone, Copy)]
pub struct Symbolic {
    pub tried: u64,
    pub seed: u64,
}

impl Default for Symbolic {
    fn default() -> Self {
        Symbolic { tried: 30_000, seed: 1 }
    }
}

/// Blocks that the formulas are tried on.
const BLOCKS: usize = 700;
/// Nodes of the longest formula.
const LONGEST: usize = 14;
/// Two operands at most.
const ARITY: usize = 2;
const ISLANDS: usize = 6;
const GENERATIONS: usize = 1000;
const CYCLES: usize = 60;

type Formula = PostfixExpr<f64, BuiltinOpsF64, ARITY>;

/// What formulas are made of, in order.
const FEATURES: usize = 6;
const COLUMN: u16 = 0;
const ROW: u16 = 1;
const DISPARITY: u16 = 2;
const RADIUS: u16 = 3;
const TILT: u16 = 4;
const PHASE: u16 = 5;

fn features(frame: &Frame, places: &[Place]) -> Array2<f64> {
    let one = |p: &Place| {
        let [u, v, d] = frame.of_place(p);
        [u, v, d, p.radius, p.theta, TAU * p.disparity]
    };
    let rows: Vec<[f64; FEATURES]> = places.iter().map(one).collect();
    Array2::from_shape_fn((FEATURES, rows.len()), |(k, i)| rows[i][k])
}

fn value(formula: &Formula, x: &Array2<f64>) -> Vec<f64> {
    let options = EvalOptions { check_finite: false, early_exit: false };
    eval_tree_array::<f64, BuiltinOpsF64, ARITY>(formula, x.view(), &options).0
}

impl Symbolic {
    /// Formulas that are the best of their length.
    fn search(&self, x: &Array2<f64>, y: &[f64], weights: &[f64]) -> Result<Vec<Formula>> {
        let operators: Operators<ARITY> = BuiltinOpsF64::from_names(["+", "sub", "*", "/", "sin"])
            .map_err(|e| Error::Solver {
                what: format!("symbolic regression: {e:?}"),
                remedy: "this is a fault of the program",
            })?;
        let options = Options::<f64, ARITY> {
            operators,
            seed: self.seed,
            niterations: GENERATIONS,
            populations: ISLANDS,
            ncycles_per_iteration: CYCLES,
            maxsize: LONGEST,
            max_evals: self.tried,
            deterministic: true,
            progress: false,
            ..Options::default()
        };
        let names = ["u", "v", "d", "r", "theta", "phase"].map(String::from).to_vec();
        let data = Dataset::with_weights_and_names(
            x.clone(),
            Array1::from_vec(y.to_vec()),
            Some(Array1::from_vec(weights.to_vec())),
            names,
        );
        let mut engine = SearchEngine::<f64, BuiltinOpsF64, ARITY>::new(data, options);
        // One task at a time: several would come back in any order.
        while engine.step(1) > 0 {}
        Ok(engine.hall_of_fame().pareto_front().into_iter().map(|m| m.expr).collect())
    }
}

/// The formula to keep, times a factor; none where none is worth its length.
struct Kept {
    formula: Formula,
    factor: f64,
}

impl Kept {
    /// Constants, and the factor.
    fn parameters(&self) -> usize {
        self.formula.consts.len() + 1
    }

    fn has(&self, feature: u16) -> bool {
        self.formula.nodes.iter().any(|n| *n == PNode::Var { feature })
    }

    fn has_sine(&self) -> bool {
        self.formula.nodes.iter().any(|n| matches!(n, PNode::Op { arity: 1, .. }))
    }

    fn is_radial(&self) -> bool {
        self.has(RADIUS) || self.has(COLUMN) && self.has(ROW)
    }

    fn cause_of_bias(&self) -> Option<&'static str> {
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

    fn cause_of_variance(&self) -> Option<&'static str> {
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

    fn at_places(self, frame: Frame) -> AtPlaces {
        Box::new(move |places| {
            let mut values = value(&self.formula, &features(&frame, places));
            values.iter_mut().for_each(|v| *v *= self.factor);
            values
        })
    }
}

/// The least BIC. `column` makes of a formula's values what is compared with `target`, both over
/// standard errors.
fn keep(
    formulas: Vec<Formula>,
    x: &Array2<f64>,
    target: &DVector<f64>,
    column: &dyn Fn(&[f64]) -> DVector<f64>,
    log_n: f64,
) -> Option<(Kept, DVector<f64>)> {
    let mut best: Option<(f64, Kept, DVector<f64>)> = None;
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
            best = Some((worth, kept, g * factor));
        }
    }
    best.map(|(_, kept, fitted)| (kept, fitted))
}

impl Baseline for Symbolic {
    fn name(&self) -> &'static str {
        "symbolic-regression"
    }

    fn fit(&self, tiles: &Tiles) -> Result<Fitted> {
        let frame = Frame::of(tiles);
        let blocks = tiles.blocks(BLOCKS);
        let places: Vec<Place> = blocks.tiles.iter().map(|t| t.place).collect();
        let x = features(&frame, &places);
        let log_n = tiles.tiles.iter().map(|t| t.count).sum::<f64>().ln();

        let (y, weights) = scaled(blocks.tiles.iter().map(|t| (t.mean, 1.0 / t.error_px2())));
        let target = Design::residual(&blocks);
        let column = |values: &[f64]| Design::column(&blocks, values);
        let bias = keep(self.search(&x, &y, &weights)?, &x, &target, &column, log_n);

        let fitted = bias.as_ref().map_or(&[][..], |b| b.1.as_slice());
        let logs: Vec<f64> = ratios(&blocks, fitted).iter().map(|r| r.max(1e-6).ln()).collect();
        // The logarithm of a mean of n squares has a variance of 2 / n.
        let half = |i: usize| 0.5 * blocks.tiles[i].count;
        let (y, weights) = scaled(logs.iter().enumerate().map(|(i, log)| (*log, half(i))));
        let weigh = |v: &[f64]| DVector::from_fn(v.len(), |i, _| v[i] * half(i).sqrt());
        let formulas = self.search(&x, &y, &weights)?;
        let variance = keep(formulas, &x, &weigh(&logs), &weigh, log_n);

        let (bias, variance) = (bias.map(|b| b.0), variance.map(|v| v.0));
        let parameters = [&bias, &variance].into_iter().flatten().map(Kept::parameters).sum();
        let causes = [
            bias.as_ref().and_then(Kept::cause_of_bias),
            variance.as_ref().and_then(Kept::cause_of_variance),
        ];
        let predictor = Learnt {
            scale_px_m: tiles.scale_px_m,
            bias: bias.map(|b| b.at_places(frame)),
            log_variance: variance.map(|v| v.at_places(frame)),
            stride: 1,
        };
        let names = causes.into_iter().flatten().map(String::from).collect();
        Ok(Fitted { predictor: Box::new(predictor), parameters, names: Some(names) })
    }
}

/// Values in units of their root mean square, weights in units of their mean: so that the search's
/// own constants fit.
fn scaled(values: impl Iterator<Item = (f64, f64)>) -> (Vec<f64>, Vec<f64>) {
    let (mut y, mut weights): (Vec<f64>, Vec<f64>) = values.unzip();
    let n = y.len().max(1) as f64;
    let mean = (weights.iter().sum::<f64>() / n).max(f64::MIN_POSITIVE);
    let rms = (y.iter().map(|y| y * y).sum::<f64>() / n).sqrt().max(f64::MIN_POSITIVE);
    y.iter_mut().for_each(|y| *y /= rms);
    weights.iter_mut().for_each(|w| *w /= mean);
    (y, weights)
}
