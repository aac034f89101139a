//! Gaussian processes over the picture and the inverse depth: of the bias, with every view's plane
//! free, and of the log variance. Squared exponential, a length for each axis (Rasmussen and
//! Williams 2006, chapter 5): lengths, size and noise by marginal likelihood.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::learnt::{AtPlaces, Learnt, each};
use super::linear::{Design, ratios};
use super::polynomial::Frame;
use super::tiles::{Tile, Tiles};
use super::{Baseline, Fitted};
use crate::error::Result;
use crate::terms::PixelContext;

#[derive(Debug, Clone, Copy)]
pub struct GaussianProcess;

/// Its cost goes with the cube: blocks to settle the hyperparameters with, and blocks to fit.
const FEW: usize = 260;
const MOST: usize = 450;
/// Blocks that the bias is taken out of before the noise is looked at.
const MANY: usize = 4000;
/// Factors by which the hyperparameters are tried, a round each.
const TRIED: [f64; 2] = [2.5, 1.6];
/// Variance of a plane's coefficients over that of the bias: as good as free.
const FREE: f64 = 1e3;
/// Of the standard error, squared: measurements that are alone in their block.
const MIN_NOISE: f64 = 1e-12;

/// What is regressed.
struct Problem {
    at: Vec<[f64; 3]>,
    /// View of each and its place in it, for a plane; none where no plane is free.
    planes: Vec<(usize, [f64; 3])>,
    y: DVector<f64>,
    noise: Vec<f64>,
}

/// Lengths, standard deviation, and factor on the noise's variance.
#[derive(Debug, Clone, Copy)]
struct Hyper {
    lengths: [f64; 3],
    size: f64,
    noise: f64,
}

struct Posterior {
    hyper: Hyper,
    at: Vec<[f64; 3]>,
    alpha: DVector<f64>,
    /// Degrees of freedom that the data fill.
    freedom: f64,
}

impl Hyper {
    fn covariance(&self, a: &[f64; 3], b: &[f64; 3]) -> f64 {
        let far: f64 = (0..3).map(|k| ((a[k] - b[k]) / self.lengths[k]).powi(2)).sum();
        self.size * self.size * (-0.5 * far).exp()
    }

    fn scaled(&self, which: usize, factor: f64) -> Self {
        let mut next = *self;
        match which {
            0..=2 => next.lengths[which] *= factor,
            3 => next.size *= factor,
            _ => next.noise *= factor * factor,
        }
        next
    }

    fn is_sound(&self) -> bool {
        self.lengths.iter().all(|l| (0.05..20.0).contains(l)) && (0.2..200.0).contains(&self.noise)
    }
}

impl Problem {
    fn covariance(&self, hyper: &Hyper) -> DMatrix<f64> {
        let n = self.at.len();
        let mut k = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                k[(i, j)] = hyper.covariance(&self.at[i], &self.at[j]);
                k[(j, i)] = k[(i, j)];
            }
        }
        k
    }

    fn whole(&self, hyper: &Hyper) -> Option<Cholesky<f64, Dyn>> {
        let mut k = self.covariance(hyper);
        let free = FREE * hyper.size * hyper.size;
        for i in 0..k.nrows() {
            for j in 0..k.nrows() {
                if let (Some((a, p)), Some((b, q))) = (self.planes.get(i), self.planes.get(j))
                    && a == b
                {
                    k[(i, j)] += free * (p[0] * q[0] + p[1] * q[1] + p[2] * q[2]);
                }
            }
            k[(i, i)] += hyper.noise * self.noise[i];
        }
        k.cholesky()
    }

    /// Logarithm of the marginal likelihood, but for a constant.
    fn evidence(&self, hyper: &Hyper) -> f64 {
        if !hyper.is_sound() {
            return f64::NEG_INFINITY;
        }
        let Some(whole) = self.whole(hyper) else { return f64::NEG_INFINITY };
        let log: f64 = whole.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        -0.5 * self.y.dot(&whole.solve(&self.y)) - log
    }

    /// By turns, each up and down.
    fn settle(&self) -> Hyper {
        let square = self.y.norm_squared() / self.y.len().max(1) as f64;
        let size = square.sqrt().max(1e-6);
        let mut best = Hyper { lengths: [0.8, 0.8, 0.8], size, noise: 1.0 };
        let mut most = self.evidence(&best);
        for factor in TRIED {
            for which in 0..5 {
                for step in [factor, 1.0 / factor] {
                    let next = best.scaled(which, step);
                    let evidence = self.evidence(&next);
                    if evidence > most {
                        (best, most) = (next, evidence);
                        break;
                    }
                }
            }
        }
        best
    }

    fn posterior(&self, hyper: Hyper) -> Option<Posterior> {
        let whole = self.whole(&hyper)?;
        let alpha = whole.solve(&self.y);
        let freedom = self.covariance(&hyper).component_mul(&whole.inverse()).sum();
        Some(Posterior { hyper, at: self.at.clone(), alpha, freedom })
    }
}

impl Posterior {
    fn mean(&self, at: &[f64; 3]) -> f64 {
        let terms = self.at.iter().zip(self.alpha.iter());
        terms.map(|(b, alpha)| alpha * self.hyper.covariance(at, b)).sum()
    }
}

fn of_bias(blocks: &Tiles, frame: &Frame) -> Problem {
    let camera = &blocks.sensor.camera;
    let (fx, fy) = (2.0 * camera.fx / camera.width as f64, 2.0 * camera.fy / camera.height as f64);
    let tiles = &blocks.tiles;
    let plane = |view: usize, t: &Tile| (view, [1.0, fx * t.place.x, fy * t.place.y]);
    let views = blocks.views.iter().enumerate();
    Problem {
        at: tiles.iter().map(|t| frame.of_place(&t.place)).collect(),
        planes: views
            .flat_map(|(view, range)| tiles[range.clone()].iter().map(move |t| plane(view, t)))
            .collect(),
        y: DVector::from_iterator(tiles.len(), tiles.iter().map(|t| t.mean)),
        noise: tiles.iter().map(|t| t.error_px2().max(MIN_NOISE)).collect(),
    }
}

/// Logarithm of the mean square about the fitted bias, and its level.
fn of_variance(blocks: &Tiles, frame: &Frame) -> (Problem, f64) {
    let tiles = &blocks.tiles;
    let y: Vec<f64> = tiles.iter().map(|t| (t.square / t.variance).max(1e-6).ln()).collect();
    let count: f64 = tiles.iter().map(|t| t.count).sum();
    let level = tiles.iter().zip(&y).map(|(t, y)| t.count * y).sum::<f64>() / count;
    let problem = Problem {
        at: tiles.iter().map(|t| frame.of_place(&t.place)).collect(),
        planes: Vec::new(),
        y: DVector::from_iterator(y.len(), y.iter().map(|y| y - level)),
        noise: tiles.iter().map(|t| 2.0 / t.count).collect(),
    };
    (problem, level)
}

/// Noise about the bias, in blocks within which the bias hardly changes.
fn noise_about(bias: Option<&Posterior>, tiles: &Tiles, frame: &Frame) -> Tiles {
    let blocks = tiles.blocks(MANY);
    let at = |p: &Posterior| -> Vec<f64> {
        blocks.tiles.iter().map(|t| p.mean(&frame.of_place(&t.place))).collect()
    };
    let fitted =
        bias.map_or_else(Vec::new, |p| Design::column(&blocks, &at(p)).as_slice().to_vec());
    blocks.of_ratios(&ratios(&blocks, &fitted))
}

impl Baseline for GaussianProcess {
    fn name(&self) -> &'static str {
        "gaussian-process"
    }

    fn fit(&self, tiles: &Tiles) -> Result<Fitted> {
        let frame = Frame::of(tiles);
        let (few, most) = (tiles.blocks(FEW), tiles.blocks(MOST));
        let hyper = of_bias(&few, &frame).settle();
        let bias = of_bias(&most, &frame).posterior(hyper);
        let noise = noise_about(bias.as_ref(), tiles, &frame);
        let hyper = of_variance(&noise.blocks(FEW), &frame).0.settle();
        let (problem, level) = of_variance(&noise.blocks(MOST), &frame);
        let variance = problem.posterior(hyper);
        let freedom = |p: &Option<Posterior>| p.as_ref().map_or(0.0, |p| p.freedom);
        // Five hyperparameters each, and a level.
        let parameters = (freedom(&bias) + freedom(&variance)).round() as usize + 11;
        let predictor = Learnt {
            scale_px_m: tiles.scale_px_m,
            bias: bias.map(|b| at_place(b, frame, 0.0)),
            log_variance: variance.map(|v| at_place(v, frame, level)),
            stride: (tiles.sensor.camera.width / 40).max(1),
        };
        Ok(Fitted { predictor: Box::new(predictor), parameters, names: None })
    }
}

fn at_place(posterior: Posterior, frame: Frame, level: f64) -> AtPlaces {
    each(move |p: &PixelContext| level + posterior.mean(&frame.of_place(p)))
}
