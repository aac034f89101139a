//! What pixels of an image share with their neighbours and with their row and column: mean
//! products over all pairs.
//!
//! With S the sum over a row, S^2 less the diagonal is the score of a variance that the row shares;
//! the products with a box around each pixel are that of one shared with neighbours. Each costs a
//! few passes over the image.

use nalgebra::{Matrix3, Vector3, Vector5};

use super::texture::without_outliers;
use crate::diagnose::views::box_sums::over_boxes;
use crate::solve::plane_equations;
use crate::stats::mean_square;

/// Reach of the neighbourhood, px.
pub const REACH_PX: usize = 4;
/// Weight of the neighbours beyond the eight nearest. Flat windows of 2 to 9 px then show 58 to 81 % of the
/// information of all lags; with equal weights, one of 3 px shows 23 % and those of 7 to 9 px up to 76 % in place
/// of 60 %.
const OUTER_WEIGHT: f64 = 0.25;
/// Lengths of a line's blocks, px; the second divides the first. Pixels of touching blocks may share a window;
/// where the noise has none, the short ones keep more pairs.
const BLOCKS_PX: [usize; 2] = [16, 4];
/// Fewest pairs for an estimate.
const MIN_PAIRS: f64 = 1000.0;

/// Mean products, px^2.
#[derive(Debug, Clone, Copy)]
pub struct Pairs {
    /// Of each pixel with itself.
    pub power: f64,
    /// Of pixels of one row or column, for blocks of either length.
    pub lines: [Lines; 2],
    /// Of neighbours, without what rows and columns share: weighted, and of all alike.
    pub near: [f64; 2],
    /// Square of the standard error of the weighted one in white noise, as a share of `power`.
    pub near_variance: f64,
}

/// Mean products of pixels of one line in blocks that do not touch, px^2.
#[derive(Debug, Clone, Copy, Default)]
pub struct Lines {
    pub row: Option<f64>,
    pub column: Option<f64>,
    /// Number of these pairs in rows and in columns, each counted twice.
    pub pairs: [f64; 2],
}

impl Pairs {
    /// Measures an image of the noise of words of this step, less any plane in it; NaN where there is no value.
    pub fn of(image: &[f32], width: usize, step_px: f64) -> Option<Self> {
        let (level, plane) = Plane::taken_from(image, width)?;
        let level = without_outliers(&level, step_px);
        let height = level.len() / width;
        let pixels = level.iter().filter(|r| r.is_finite()).count() as f64;
        let power = mean_square(&level)?;
        let beside = neighbours(&level, width, REACH_PX);
        if beside.pairs < MIN_PAIRS {
            return None;
        }
        // The plane took part of every product with it: the noise of the pixels correlated within the reach,
        // times the leverage of the two pixels on each other. That averages three over the number of pixels
        // for neighbours, as for a pixel on itself.
        let taken = power + beside.products / pixels;
        let of_lines = |count: usize, length: usize, at: &dyn Fn(usize, usize) -> usize| {
            let mut sums = [(Sum::default(), 0.0); 2];
            for line in 0..count {
                let pixels = (0..length).map(|k| at(line, k));
                let seen = pixels.map(|i| {
                    level[i].is_finite().then(|| (f64::from(level[i]), plane.whitened(i)))
                });
                let blocks = in_blocks(seen);
                for ((sum, leverages), length) in sums.iter_mut().zip(BLOCKS_PX) {
                    let (own, leverage) = along(&blocks, length);
                    *sum = sum.and(own);
                    *leverages += leverage;
                }
            }
            sums.map(|(sum, leverage)| {
                let products = (sum.products + taken * leverage) / sum.pairs;
                ((sum.pairs >= MIN_PAIRS).then_some(products), sum.pairs)
            })
        };
        let rows = of_lines(height, width, &|line, k| line * width + k);
        let columns = of_lines(width, height, &|line, k| k * width + line);
        let lines = [0, 1].map(|k| Lines {
            row: rows[k].0,
            column: columns[k].0,
            pairs: [rows[k].1, columns[k].1],
        });
        let nearest = neighbours(&level, width, 1);
        let weighted = beside.times(OUTER_WEIGHT).and(nearest.times(1.0 - OUTER_WEIGHT));
        let shared = lines[0].row.unwrap_or(0.0) + lines[0].column.unwrap_or(0.0);
        let near =
            [(weighted, ON_THE_LINE_WEIGHTED), (beside, ON_THE_LINE)].map(|(sum, on_the_line)| {
                sum.products / sum.pairs + 3.0 * taken / pixels - shared * on_the_line
            });
        let near_variance = 2.0 * WEIGHTS / (EFFECTIVE_NEIGHBOURS * weighted.pairs);
        Some(Pairs { power, lines, near, near_variance })
    }
}

/// Number of neighbours of a pixel, and the share of them in its own row.
pub const NEIGHBOURS: usize = (2 * REACH_PX + 1) * (2 * REACH_PX + 1) - 1;
const ON_THE_LINE: f64 = (2 * REACH_PX) as f64 / NEIGHBOURS as f64;
/// Sum of the neighbours' weights, and their share in the pixel's own row.
const WEIGHTS: f64 = 8.0 + (NEIGHBOURS - 8) as f64 * OUTER_WEIGHT;
const ON_THE_LINE_WEIGHTED: f64 = (2.0 + (2 * REACH_PX - 2) as f64 * OUTER_WEIGHT) / WEIGHTS;
/// Number of neighbours of equal weight whose mean product would scatter as the weighted one.
const EFFECTIVE_NEIGHBOURS: f64 =
    WEIGHTS * WEIGHTS / (8.0 + (NEIGHBOURS - 8) as f64 * OUTER_WEIGHT * OUTER_WEIGHT);

/// Sum of the products of pairs, each counted twice, and their number.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    products: f64,
    pairs: f64,
}

impl Sum {
    fn times(self, weight: f64) -> Sum {
        Sum { products: weight * self.products, pairs: weight * self.pairs }
    }

    fn and(self, other: Sum) -> Sum {
        Sum { products: self.products + other.products, pairs: self.pairs + other.pairs }
    }
}

/// Sums over a block of a line's pixels: of their number, their values and the columns of the plane, whitened.
type Block = Vector5<f64>;

/// A line in its short blocks; `None` where there is no value.
fn in_blocks(line: impl Iterator<Item = Option<(f64, Vector3<f64>)>>) -> Vec<Block> {
    let [_, short] = BLOCKS_PX;
    let mut blocks = Vec::new();
    for (k, seen) in line.enumerate() {
        if k % short == 0 {
            blocks.push(Block::zeros());
        }
        if let (Some((r, w)), Some(block)) = (seen, blocks.last_mut()) {
            *block += Block::new(1.0, r, w.x, w.y, w.z);
        }
    }
    blocks
}

/// Sums over pairs of a line's pixels in blocks of this length that do not touch: of their products, and of
/// the plane's leverage of one on the other.
fn along(blocks: &[Block], length: usize) -> (Sum, f64) {
    let [_, short] = BLOCKS_PX;
    // Sums of all, of the pairs in blocks that touch, and of the block before.
    let [mut whole, mut close, mut before] = [Block::zeros(); 3];
    for merged in blocks.chunks(length / short) {
        let block: Block = merged.iter().sum();
        whole += block;
        close += block.component_mul(&(block + 2.0 * before));
        before = block;
    }
    let apart = whole.component_mul(&whole) - close;
    (Sum { pairs: apart[0], products: apart[1] }, apart[2] + apart[3] + apart[4])
}

/// Sums over pairs within `reach` of each other, by box sums.
fn neighbours(image: &[f32], width: usize, reach: usize) -> Sum {
    let mut sum = Sum::default();
    over_boxes(image, width, reach, |i, products, pairs| {
        let r = f64::from(image[i]);
        sum.products += r * (products - r);
        sum.pairs += pairs - 1.0;
    });
    sum
}

/// A plane fitted to an image by least squares.
struct Plane {
    width: usize,
    centre: [f64; 2],
    /// Inverse of the Cholesky factor of its normal equations.
    whitening: Matrix3<f64>,
}

impl Plane {
    /// Subtracts the plane from the image; `None` with too few pixels for one.
    fn taken_from(image: &[f32], width: usize) -> Option<(Vec<f32>, Plane)> {
        let centre = [width, image.len() / width].map(|side| 0.5 * side as f64);
        let mut plane = Plane { width, centre, whitening: Matrix3::zeros() };
        let points = image.iter().enumerate().map(|(i, r)| (plane.place(i), f64::from(*r), 1.0));
        let (a, b) = plane_equations(points);
        let factor = a.cholesky()?;
        let fit = factor.solve(&b);
        plane.whitening = factor.l().try_inverse()?;
        let less = |(i, r): (usize, &f32)| r - fit.dot(&plane.columns(i)) as f32;
        Some((image.iter().enumerate().map(less).collect(), plane))
    }

    fn place(&self, i: usize) -> [f64; 2] {
        let [u0, v0] = self.centre;
        [((i % self.width) as f64 - u0) / u0, ((i / self.width) as f64 - v0) / v0]
    }

    fn columns(&self, i: usize) -> Vector3<f64> {
        let [x, y] = self.place(i);
        Vector3::new(1.0, x, y)
    }

    /// Columns whose products are the leverage of two pixels on each other.
    fn whitened(&self, i: usize) -> Vector3<f64> {
        self.whitening * self.columns(i)
    }
}

#[cfg(test)]
#[path = "pairs_tests.rs"]
mod tests;
