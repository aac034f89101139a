//! Gaussian process of the bias over the image and the disparity, with a free plane in every view.
//! Squared-exponential kernel with one length per axis (Rasmussen and Williams 2006, chapter 5); lengths,
//! amplitude and noise by marginal likelihood.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::{Learnt, Tile, Tiles};

/// Number of blocks for choosing the hyperparameters, and for the fit; the cost grows with its cube.
const SETTLE: usize = 260;
const FIT: usize = 450;
/// Factors by which the hyperparameters are varied, one per round.
const TRIED: [f64; 2] = [2.5, 1.6];
/// Prior variance of a plane's coefficients relative to that of the bias: practically free.
const FREE: f64 = 1e3;
/// Lower limit of a block's squared standard error, px^2.
const MIN_NOISE: f64 = 1e-12;

/// The regression problem.
struct Problem {
    at: Vec<[f64; 3]>,
    view: Vec<usize>,
    y: DVector<f64>,
    noise: Vec<f64>,
    /// Variance of the coefficients of a view's plane relative to that of the bias.
    free: f64,
}

/// Lengths, amplitude (standard deviation), and factor on the noise's standard deviation.
#[derive(Debug, Clone, Copy)]
struct Hyper {
    lengths: [f64; 3],
    size: f64,
    noise: f64,
}

impl Hyper {
    fn covariance(&self, a: &[f64; 3], b: &[f64; 3]) -> f64 {
        let far: f64 = (0..3).map(|k| ((a[k] - b[k]) / self.lengths[k]).powi(2)).sum();
        self.size * self.size * (-0.5 * far).exp()
    }

    fn scaled(mut self, which: usize, factor: f64) -> Self {
        let [a, b, c] = &mut self.lengths;
        *[a, b, c, &mut self.size, &mut self.noise][which] *= factor;
        self
    }

    fn is_sound(&self) -> bool {
        self.lengths.iter().all(|l| (0.05..20.0).contains(l)) && (0.45..14.0).contains(&self.noise)
    }
}

impl Problem {
    /// Problem of these tiles at their scaled places. A plane is affine in the image coordinates and free
    /// in every view.
    fn of(tiles: &[Tile], place: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        Problem {
            at: tiles.iter().map(|t| place(t.at)).collect(),
            view: tiles.iter().map(|t| t.view).collect(),
            y: DVector::from_iterator(tiles.len(), tiles.iter().map(|t| t.mean)),
            noise: tiles.iter().map(|t| (t.variance / t.count).max(MIN_NOISE)).collect(),
            free: FREE,
        }
    }

    fn covariance(&self, hyper: &Hyper) -> Option<Cholesky<f64, Dyn>> {
        let n = self.at.len();
        let free = self.free * hyper.size * hyper.size;
        let of = |i: usize, j: usize| {
            let (a, b) = (&self.at[i], &self.at[j]);
            let plane = if self.view[i] == self.view[j] { free } else { 0.0 };
            let own = if i == j { hyper.noise.powi(2) * self.noise[i] } else { 0.0 };
            hyper.covariance(a, b) + plane * (1.0 + a[0] * b[0] + a[1] * b[1]) + own
        };
        DMatrix::from_fn(n, n, of).cholesky()
    }

    /// Log marginal likelihood, up to a constant.
    fn evidence(&self, hyper: &Hyper) -> f64 {
        let Some(whole) = self.covariance(hyper).filter(|_| hyper.is_sound()) else {
            return f64::NEG_INFINITY;
        };
        let log: f64 = whole.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        -0.5 * self.y.dot(&whole.solve(&self.y)) - log
    }

    /// Coordinate search for the hyperparameters: each in turn, up and down.
    fn settle(&self) -> Hyper {
        let square = self.y.norm_squared() / self.y.len().max(1) as f64;
        let mut best = Hyper { lengths: [0.8; 3], size: square.sqrt().max(1e-6), noise: 1.0 };
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

    /// Posterior mean; zero everywhere if the covariance is not positive definite.
    fn mean(self, hyper: Hyper) -> impl Fn([f64; 3]) -> f64 + Send + Sync {
        let alpha = self.covariance(&hyper).map_or(DVector::zeros(0), |c| c.solve(&self.y));
        move |at| {
            let terms = self.at.iter().zip(alpha.iter());
            terms.map(|(b, alpha)| alpha * hyper.covariance(&at, b)).sum()
        }
    }
}

pub fn fit(tiles: &Tiles) -> Learnt {
    let camera = &tiles.sensor.camera;
    let [low, high] = kinoise::stats::range(tiles.tiles.iter().map(|t| t.at[2]));
    let (w, h) = (camera.width as f64 / 2.0, camera.height as f64 / 2.0);
    // Scales the recording's span to -1 .. 1.
    let (middle, half) = ([w, h, 0.5 * (low + high)], [w, w, (0.5 * (high - low)).max(1e-6)]);
    let place =
        move |at: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| (at[k] - middle[k]) / half[k]) };
    let hyper = Problem::of(&tiles.blocks(SETTLE), place).settle();
    let mean = Problem::of(&tiles.blocks(FIT), place).mean(hyper);
    Learnt {
        scale_px_m: tiles.scale_px_m,
        bias: Box::new(move |at| mean(place(at))),
        stride: (camera.width / 40).max(1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Posterior means of scikit-learn 1.9.1 at the two places below.
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
        let problem = Problem { at, view: vec![0; 5], y, noise, free: 0.0 };
        let mean = problem.mean(Hyper { lengths: [0.5, 1.0, 2.0], size: 0.7, noise: 0.1 });
        for (at, expected) in [([0.1, 0.1, 0.1], SKLEARN[0]), ([-0.5, 0.0, 0.5], SKLEARN[1])] {
            assert!((mean(at) - expected).abs() < 1e-9, "{}", mean(at));
        }
    }
}
