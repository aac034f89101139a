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

use nalgebra::DVector;
use ndarray::{Array1, Array2};
use symbolic_regression::prelude::BuiltinOpsF64;
use symbolic_regression::{Dataset, Operators, Options, SearchEngine};

use super::formula::{ARITY, Formula, Kept, NAMES, features, keep, value};
use super::learnt::Learnt;
use super::linear::{Design, ratios};
use super::polynomial::Frame;
use super::tiles::Tiles;
use super::{Baseline, Fitted};
use crate::error::{Error, Result};
use crate::terms::PixelContext;

/// How long it searches: formulas tried, for the bias and for the variance each. A limit in time
/// would give another answer on another day.
#[derive(Debug, Clone, Copy)]
pub struct Symbolic {
    pub tried: u64,
    pub seed: u64,
}

impl Default for Symbolic {
    fn default() -> Self {
        Symbolic { tried: 12_000, seed: 1 }
    }
}

/// Blocks that the formulas are tried on.
const BLOCKS: usize = 700;
/// Nodes of the longest formula.
const LONGEST: usize = 14;
const ISLANDS: usize = 6;
const GENERATIONS: usize = 1000;
const CYCLES: usize = 60;

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
        let names = NAMES.map(String::from).to_vec();
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

    fn bias(&self, tiles: &Tiles, frame: &Frame, log_n: f64) -> Result<Option<Kept>> {
        let blocks = tiles.blocks(BLOCKS);
        let x = features(frame, &places(&blocks));
        let (y, weights) = scaled(blocks.tiles.iter().map(|t| (t.mean, 1.0 / t.error_px2())));
        let column = |values: &[f64]| Design::column(&blocks, values);
        let formulas = self.search(&x, &y, &weights)?;
        Ok(keep(formulas, &x, &Design::residual(&blocks), &column, log_n))
    }

    fn variance(
        &self,
        tiles: &Tiles,
        bias: Option<&Kept>,
        frame: &Frame,
        log_n: f64,
    ) -> Result<Option<Kept>> {
        // Within a block the bias changes, and must not pass for noise.
        let fitted = bias.map_or_else(Vec::new, |kept| {
            let values = value(&kept.formula, &features(frame, &places(tiles)));
            (Design::column(tiles, &values) * kept.factor).as_slice().to_vec()
        });
        let blocks = tiles.of_ratios(&ratios(tiles, &fitted)).blocks(BLOCKS);
        let x = features(frame, &places(&blocks));
        // The logarithm of a mean of n squares has a variance of 2 / n.
        let halves: Vec<f64> = blocks.tiles.iter().map(|t| 0.5 * t.count).collect();
        let logs: Vec<f64> =
            blocks.tiles.iter().map(|t| (t.square / t.variance).max(1e-6).ln()).collect();
        let (y, weights) = scaled(logs.iter().copied().zip(halves.iter().copied()));
        let weigh = |v: &[f64]| DVector::from_fn(v.len(), |i, _| v[i] * halves[i].sqrt());
        let formulas = self.search(&x, &y, &weights)?;
        Ok(keep(formulas, &x, &weigh(&logs), &weigh, log_n))
    }
}

fn places(tiles: &Tiles) -> Vec<PixelContext> {
    tiles.tiles.iter().map(|t| t.place).collect()
}

impl Baseline for Symbolic {
    fn name(&self) -> &'static str {
        "symbolic-regression"
    }

    fn fit(&self, tiles: &Tiles) -> Result<Fitted> {
        let frame = Frame::of(tiles);
        let log_n = tiles.tiles.iter().map(|t| t.count).sum::<f64>().ln();
        let bias = self.bias(tiles, &frame, log_n)?;
        let variance = self.variance(tiles, bias.as_ref(), &frame, log_n)?;
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
