//! Iso-lines of a sampled surface: marching squares, and places for the labels.

use crate::report::axis::Axis;
use crate::report::chart::{Layer, Stroke};
use crate::report::colours::INK;
use crate::stats::range;

/// A surface sampled on the corners of a lattice.
pub(super) struct Grid {
    x: Vec<f64>,
    y: Vec<f64>,
    /// Row by row, `x` fastest.
    value: Vec<f64>,
}

impl Grid {
    /// Denser towards the upper end of `y`, where the forms bend to their poles.
    pub fn sample(
        x: [f64; 2],
        y: [f64; 2],
        cells: [usize; 2],
        f: &dyn Fn(f64, f64) -> f64,
    ) -> Self {
        let along = |[low, high]: [f64; 2], n: usize, share: fn(f64) -> f64| -> Vec<f64> {
            (0..=n).map(|i| low + (high - low) * share(i as f64 / n as f64)).collect()
        };
        let (x, y) = (along(x, cells[0], |s| s), along(y, cells[1], |s| s * (2.0 - s)));
        let value = y.iter().flat_map(|&v| x.iter().map(move |&u| f(u, v))).collect();
        Grid { x, y, value }
    }

    pub fn range(&self) -> [f64; 2] {
        range(self.value.iter().copied())
    }

    /// Corners of a cell in turn, each with its value.
    fn corners(&self, i: usize, j: usize) -> [([f64; 2], f64); 4] {
        [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            .map(|(i, j)| ([self.x[i], self.y[j]], self.value[j * self.x.len() + i]))
    }

    fn pieces(&self, level: f64) -> Vec<[[f64; 2]; 2]> {
        let mut pieces = Vec::new();
        for j in 0..self.y.len() - 1 {
            for i in 0..self.x.len() - 1 {
                let crossings = crossings(&self.corners(i, j), level);
                pieces.extend(crossings.chunks_exact(2).map(|p| [p[0], p[1]]));
            }
        }
        pieces
    }
}

/// Where the level crosses the sides of a cell: none, two, or (a saddle) four times.
fn crossings(corners: &[([f64; 2], f64); 4], level: f64) -> Vec<[f64; 2]> {
    (0..4)
        .filter_map(|k| {
            let ((p, a), (q, b)) = (corners[k], corners[(k + 1) % 4]);
            ((a < level) != (b < level)).then(|| {
                let share = (level - a) / (b - a);
                [p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])]
            })
        })
        .collect()
}

/// Labels stand at this height of the map where their line comes by, and keep this far apart
/// (shares of the map).
const LABEL_HEIGHT: f64 = 0.3;
const LABELS_APART: [f64; 2] = [0.08, 0.06];
/// ... and this far from its sides.
const LABEL_INSET: f64 = 0.02;

/// Lines at these levels, and labels over them.
pub(super) fn layers(grid: &Grid, levels: &[f64]) -> impl Iterator<Item = Layer> {
    let (mut lines, mut labels) = (Vec::new(), Vec::new());
    let mut taken: Vec<[f64; 2]> = Vec::new();
    for &level in levels {
        let pieces = grid.pieces(level);
        if let Some(at) = place(grid, &pieces, &taken) {
            taken.push(at);
            labels.push(Layer::Label(at, Axis::label(level)));
        }
        let line = |piece: &[[f64; 2]; 2]| Layer::Line(piece.to_vec(), Stroke::new(INK, 1));
        lines.extend(pieces.iter().map(line));
    }
    lines.into_iter().chain(labels)
}

fn place(grid: &Grid, pieces: &[[[f64; 2]; 2]], taken: &[[f64; 2]]) -> Option<[f64; 2]> {
    let share = |p: [f64; 2]| {
        let along = |axis: &[f64], v: f64| (v - axis[0]) / (axis[axis.len() - 1] - axis[0]);
        [along(&grid.x, p[0]), along(&grid.y, p[1])]
    };
    let free = |p: [f64; 2]| {
        let here = share(p);
        let inside = here.iter().all(|s| (LABEL_INSET..=1.0 - LABEL_INSET).contains(s));
        inside
            && taken
                .iter()
                .map(|t| share(*t))
                .all(|t| (0..2).any(|k| (here[k] - t[k]).abs() > LABELS_APART[k]))
    };
    let height = |p: &[f64; 2]| (share(*p)[1] - LABEL_HEIGHT).abs();
    pieces
        .iter()
        .map(|[a, _]| *a)
        .filter(|p| free(*p))
        .min_by(|a, b| height(a).total_cmp(&height(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_found() {
        let grid = Grid::sample([-2.0, 2.0], [-2.0, 2.0], [80, 80], &|x, y| x.hypot(y));
        let pieces = grid.pieces(1.0);
        assert!(pieces.len() > 100 && grid.pieces(5.0).is_empty());
        for [p, q] in &pieces {
            approx::assert_abs_diff_eq!(p[0].hypot(p[1]), 1.0, epsilon = 1e-3);
            assert!((p[0] - q[0]).hypot(p[1] - q[1]) < 0.1);
        }
        let layers: Vec<Layer> = layers(&grid, &[1.0, 5.0]).collect();
        assert_eq!(layers.len(), pieces.len() + 1, "one label, and none for an empty line");
    }
}
