//! Gaussian processes over the picture and the inverse depth: of the bias, with every view's plane
//! free, and of the log variance. Squared exponential, a length for each axis (Rasmussen and
//! Williams 2006, chapter 5): lengths, size and noise by marginal likelihood.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::{AtPlace, Learnt, Tile, Tiles};

pub struct GaussianProcess;

/// The cost goes with the cube: blocks to settle the hyperparameters with, and blocks to fit.
const SETTLE: usize = 260;
const FIT: usize = 450;
/// Factors by which the hyperparameters are tried, a round each.
const TRIED: [f64; 2] = [2.5, 1.6];
/// Variance of a plane's coefficients over that of the bias: as good as free.
const FREE: f64 = 1e3;
/// Of the standard error, squared: measurements that are alone in their block.
const MIN_NOISE: f64 = 1e-12;

/// Takes the recording's span to -1 .. 1.
#[derive(Clone, Copy)]
struct Frame {
    middle: [f64; 3],
    half: [f64; 3],
}

impl Frame {
    fn of(tiles: &Tiles) -> Self {
        let camera = &tiles.sensor.camera;
        let d = tiles.tiles.iter().map(|t| t.at[2]);
        let (low, high) = d.fold((f64::MAX, f64::MIN), |(l, h), d| (l.min(d), h.max(d)));
        let (w, h) = (camera.width as f64 / 2.0, camera.height as f64 / 2.0);
        let half = [w, w, (0.5 * (high - low)).max(1e-6)];
        Frame { middle: [w, h, 0.5 * (low + high)], half }
    }

    fn of_place(&self, at: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| (at[k] - self.middle[k]) / self.half[k])
    }
}

/// What is regressed.
struct Problem {
    at: Vec<[f64; 3]>,
    /// View of each, where the views' planes are free.
    views: Option<Vec<usize>>,
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
    /// Of the bias: a plane is affine in the picture's coordinates, and free in every view.
    fn of_bias(tiles: &[Tile], frame: &Frame) -> Self {
        Problem {
            at: tiles.iter().map(|t| frame.of_place(t.at)).collect(),
            views: Some(tiles.iter().map(|t| t.view).collect()),
            y: DVector::from_iterator(tiles.len(), tiles.iter().map(|t| t.mean)),
            noise: tiles.iter().map(|t| (t.variance / t.count).max(MIN_NOISE)).collect(),
        }
    }

    /// Logarithm of the mean square about the fitted bias, and its level.
    fn of_variance(tiles: &[Tile], bias: &Posterior, frame: &Frame) -> (Self, f64) {
        let left = |t: &Tile| {
            let b = bias.mean(&frame.of_place(t.at));
            (t.ratio + b * (b - 2.0 * t.mean) / t.variance).max(1e-6).ln()
        };
        let y: Vec<f64> = tiles.iter().map(left).collect();
        let count: f64 = tiles.iter().map(|t| t.count).sum();
        let level = tiles.iter().zip(&y).map(|(t, y)| t.count * y).sum::<f64>() / count;
        let problem = Problem {
            at: tiles.iter().map(|t| frame.of_place(t.at)).collect(),
            views: None,
            y: DVector::from_iterator(y.len(), y.iter().map(|y| y - level)),
            noise: tiles.iter().map(|t| 2.0 / t.count).collect(),
        };
        (problem, level)
    }

    fn covariance(&self, hyper: &Hyper) -> Option<Cholesky<f64, Dyn>> {
        let n = self.at.len();
        let free = FREE * hyper.size * hyper.size;
        let mut k = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                let (a, b) = (&self.at[i], &self.at[j]);
                let mut value = hyper.covariance(a, b);
                if self.views.as_ref().is_some_and(|views| views[i] == views[j]) {
                    value += free * (1.0 + a[0] * b[0] + a[1] * b[1]);
                }
                k[(i, j)] = value;
                k[(j, i)] = value;
            }
            k[(i, i)] += hyper.noise * self.noise[i];
        }
        k.cholesky()
    }

    /// Logarithm of the marginal likelihood, but for a constant.
    fn evidence(&self, hyper: &Hyper) -> f64 {
        let Some(whole) = self.covariance(hyper).filter(|_| hyper.is_sound()) else {
            return f64::NEG_INFINITY;
        };
        let log: f64 = whole.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        -0.5 * self.y.dot(&whole.solve(&self.y)) - log
    }

    /// By turns, each up and down.
    fn settle(&self) -> Hyper {
        let square = self.y.norm_squared() / self.y.len().max(1) as f64;
        let size = square.sqrt().max(1e-6);
        let mut best = Hyper { lengths: [0.8, 0.8, 0.8], size, noise: 1.0 };
        let mut max = self.evidence(&best);
        for factor in TRIED {
            for which in 0..5 {
                for step in [factor, 1.0 / factor] {
                    let next = best.scaled(which, step);
                    let evidence = self.evidence(&next);
                    if evidence > max {
                        (best, max) = (next, evidence);
                        break;
                    }
                }
            }
        }
        best
    }

    /// Zero everywhere where no covariance can be had.
    fn posterior(&self, hyper: Hyper) -> Posterior {
        match self.covariance(&hyper) {
            Some(whole) => Posterior { hyper, at: self.at.clone(), alpha: whole.solve(&self.y) },
            None => Posterior { hyper, at: Vec::new(), alpha: DVector::zeros(0) },
        }
    }
}

impl Posterior {
    fn mean(&self, at: &[f64; 3]) -> f64 {
        let terms = self.at.iter().zip(self.alpha.iter());
        terms.map(|(b, alpha)| alpha * self.hyper.covariance(at, b)).sum()
    }

    fn at_place(self, frame: Frame, level: f64) -> AtPlace {
        Box::new(move |at| level + self.mean(&frame.of_place(at)))
    }
}

impl GaussianProcess {
    pub fn fit(tiles: &Tiles) -> Learnt {
        let frame = Frame::of(tiles);
        let (settle, fit) = (tiles.blocks(SETTLE), tiles.blocks(FIT));
        let hyper = Problem::of_bias(&settle, &frame).settle();
        let bias = Problem::of_bias(&fit, &frame).posterior(hyper);
        let hyper = Problem::of_variance(&settle, &bias, &frame).0.settle();
        let (problem, level) = Problem::of_variance(&fit, &bias, &frame);
        let variance = problem.posterior(hyper);
        Learnt {
            scale_px_m: tiles.scale_px_m,
            bias: bias.at_place(frame, 0.0),
            log_variance: Some(variance.at_place(frame, level)),
            stride: (tiles.sensor.camera.width / 40).max(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What scikit-learn 1.9.1 says at the two places below.
    const SKLEARN: [f64; 2] = [0.262_165_055_272_696_07, 0.397_313_855_702_698_6];

    /// Against scikit-learn: GaussianProcessRegressor(0.49 * RBF([0.5, 1.0, 2.0]),
    /// alpha=0.01 * noise, optimizer=None) on these five points.
    #[test]
    fn the_posterior_mean_is_that_of_a_kept_implementation() {
        let at = vec![
            [0.0, 0.0, 0.0],
            [0.5, -0.2, 0.1],
            [-0.4, 0.3, 0.9],
            [0.8, 0.8, -0.5],
            [-0.9, -0.6, 0.4],
        ];
        let y = DVector::from_vec(vec![0.3, -0.1, 0.7, 0.2, -0.5]);
        let noise = vec![1.0, 2.0, 1.0, 4.0, 1.0];
        let problem = Problem { at, views: None, y, noise };
        let hyper = Hyper { lengths: [0.5, 1.0, 2.0], size: 0.7, noise: 0.01 };
        let posterior = problem.posterior(hyper);
        for (at, expected) in [([0.1, 0.1, 0.1], SKLEARN[0]), ([-0.5, 0.0, 0.5], SKLEARN[1])] {
            assert!((posterior.mean(&at) - expected).abs() < 1e-9, "{}", posterior.mean(&at));
        }
    }
}
