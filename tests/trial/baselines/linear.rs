//! Least squares with every view's plane taken out, and noise whose logarithm is linear.

use nalgebra::{DMatrix, DVector, Vector3};

use super::tiles::{Tile, Tiles};
use kinoise::plane::NormalEquations;

/// Columns of a design, one row a tile.
pub(super) struct Design {
    /// Divided by their standard errors; planes taken out where asked for.
    pub columns: DMatrix<f64>,
}

/// Weight of a tile's mean, 1/px^2.
fn weight(tile: &Tile) -> f64 {
    1.0 / tile.error_px2()
}

/// Take the weighted plane of every view out of a column, and weigh it.
fn without_planes(tiles: &Tiles, column: &mut [f64]) {
    for range in &tiles.views {
        let (tiles, column) = (&tiles.tiles[range.clone()], &mut column[range.clone()]);
        let mut sums = NormalEquations::default();
        for (t, c) in tiles.iter().zip(column.iter()) {
            sums.add(&Vector3::new(t.place.x, t.place.y, 1.0), *c, weight(t));
        }
        let plane = sums.solve().unwrap_or_else(Vector3::zeros);
        for (t, c) in tiles.iter().zip(column) {
            *c -= plane.dot(&Vector3::new(t.place.x, t.place.y, 1.0));
            *c *= weight(t).sqrt();
        }
    }
}

impl Design {
    /// Columns of the bias: what a plane takes up is gone from them.
    pub fn of_bias(tiles: &Tiles, count: usize, fill: &dyn Fn(&Tile, &mut [f64])) -> Self {
        let mut columns = raw(tiles, count, fill);
        for k in 0..count {
            let column: Vec<f64> = columns.column(k).iter().copied().collect();
            columns.set_column(k, &Self::column(tiles, &column));
        }
        Design { columns }
    }

    /// One column of the bias.
    pub fn column(tiles: &Tiles, values: &[f64]) -> DVector<f64> {
        let mut column = values.to_vec();
        without_planes(tiles, &mut column);
        DVector::from_vec(column)
    }

    /// The mean residuals, alike.
    pub fn residual(tiles: &Tiles) -> DVector<f64> {
        let mean: Vec<f64> = tiles.tiles.iter().map(|t| t.mean).collect();
        Self::column(tiles, &mean)
    }

    /// Columns of the log variance, weighed by the square root of half the measurements: the
    /// information that a measurement has about its own log variance is one half.
    pub fn of_variance(tiles: &Tiles, count: usize, fill: &dyn Fn(&Tile, &mut [f64])) -> Self {
        let mut columns = raw(tiles, count, fill);
        for (mut row, t) in columns.row_iter_mut().zip(&tiles.tiles) {
            row *= (0.5 * t.count).sqrt();
        }
        Design { columns }
    }
}

fn raw(tiles: &Tiles, count: usize, fill: &dyn Fn(&Tile, &mut [f64])) -> DMatrix<f64> {
    let mut row = vec![0.0; count];
    let mut columns = DMatrix::zeros(tiles.tiles.len(), count);
    for (i, t) in tiles.tiles.iter().enumerate() {
        fill(t, &mut row);
        for (k, &value) in row.iter().enumerate() {
            columns[(i, k)] = if value.is_finite() { value } else { 0.0 };
        }
    }
    columns
}

/// A symmetric system solved on what it determines.
pub(super) struct Solved {
    pub beta: DVector<f64>,
    /// Directions that are determined.
    pub rank: usize,
    /// What it takes off the sum of squares.
    pub drop: f64,
}

/// A direction with less than this share of the largest is not seen at all.
const UNSEEN: f64 = 1e-9;

pub(super) fn solve(gram: &DMatrix<f64>, right: &DVector<f64>) -> Solved {
    let n = right.len();
    // To columns of unit length; one that a plane takes up whole has only rounding left.
    let most = gram.diagonal().max().max(f64::MIN_POSITIVE);
    let scale = DVector::from_fn(n, |i, _| match gram[(i, i)] {
        g if g > UNSEEN * most => 1.0 / g.sqrt(),
        _ => 0.0,
    });
    let scaled = DMatrix::from_fn(n, n, |i, j| scale[i] * gram[(i, j)] * scale[j]);
    let eigen = scaled.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let along = eigen.eigenvectors.tr_mul(&right.component_mul(&scale));
    let seen = |l: f64| l > UNSEEN * largest && l > 0.0;
    let part = DVector::from_fn(n, |i, _| match eigen.eigenvalues[i] {
        l if seen(l) => along[i] / l,
        _ => 0.0,
    });
    let beta = (&eigen.eigenvectors * part).component_mul(&scale);
    let drop = beta.dot(right);
    Solved { beta, rank: eigen.eigenvalues.iter().filter(|l| seen(**l)).count(), drop }
}

/// Mean squares about the mean that was fitted, over the model's variance. `fitted` is the bias
/// with its planes taken out, over standard errors; nothing is fitted where it is empty.
pub(super) fn ratios(tiles: &Tiles, fitted: &[f64]) -> Vec<f64> {
    let mean = Design::residual(tiles);
    let one = |(i, t): (usize, &Tile)| {
        let left = mean[i] - fitted.get(i).copied().unwrap_or(0.0);
        let spread = (t.square - t.mean * t.mean).max(0.0);
        (spread + left * left * t.error_px2()) / t.variance
    };
    tiles.tiles.iter().enumerate().map(one).collect()
}

const ROUNDS: usize = 12;
const SETTLED: f64 = 1e-6;
/// Of the logarithm in one round.
const LONGEST_STEP: f64 = 2.0;

/// Log-linear variance by maximum likelihood (a Gamma's with the logarithm for a link, whose
/// weights are fixed): its scores are the working residuals. `columns` from [`Design::of_variance`].
pub(super) fn fit_log(tiles: &Tiles, ratios: &[f64], columns: &DMatrix<f64>) -> Solved {
    let gram = columns.tr_mul(columns);
    let mut beta: DVector<f64> = DVector::zeros(columns.ncols());
    let mut rank = 0;
    for _ in 0..ROUNDS {
        let right = columns.tr_mul(&working(tiles, ratios, columns, &beta));
        let step = solve(&gram, &right);
        rank = step.rank;
        let change = columns * &step.beta;
        let most = (0..change.len())
            .map(|i| change[i].abs() / (0.5 * tiles.tiles[i].count).sqrt())
            .fold(0.0, f64::max);
        beta += &step.beta * (LONGEST_STEP / most.max(LONGEST_STEP));
        if most < SETTLED {
            break;
        }
    }
    let drop = 2.0 * (likelihood(tiles, ratios, columns, &beta) - constant(tiles, ratios));
    Solved { beta, rank, drop }
}

/// (ratio / fitted - 1), weighed.
pub(super) fn working(
    tiles: &Tiles,
    ratios: &[f64],
    columns: &DMatrix<f64>,
    beta: &DVector<f64>,
) -> DVector<f64> {
    let eta = columns * beta;
    DVector::from_fn(ratios.len(), |i, _| {
        let w = (0.5 * tiles.tiles[i].count).sqrt();
        w * (ratios[i] * (-eta[i] / w).exp() - 1.0)
    })
}

/// Of normal measurements, nats.
fn likelihood(tiles: &Tiles, ratios: &[f64], columns: &DMatrix<f64>, beta: &DVector<f64>) -> f64 {
    let eta = columns * beta;
    let one = |(i, t): (usize, &Tile)| {
        let log = eta[i] / (0.5 * t.count).sqrt();
        -0.5 * t.count * (ratios[i] * (-log).exp() + log)
    };
    tiles.tiles.iter().enumerate().map(one).sum()
}

fn constant(tiles: &Tiles, ratios: &[f64]) -> f64 {
    tiles.tiles.iter().zip(ratios).map(|(t, r)| -0.5 * t.count * r).sum()
}
