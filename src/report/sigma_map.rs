//! Map of sigma over distance and tilt with iso-lines; what was not measured is hatched.

use plotters::style::{RGBColor, WHITE};

use super::axis::Axis;
use super::chart::{Chart, ColourScale, Entry, Layer, Mark, Sample, Stroke};
use super::colours::{self, INK};
use super::coverage::is_measured;
use super::numbers::MM;
use super::slices::tip;
use crate::measure::{SigmaRow, SigmaTable};
use crate::model::SigmaModel;
use crate::stats::range;

/// Number of colours: enough to look continuous.
const SHADES: usize = 36;
/// Cells across and down the map; a cell has one colour, and iso-lines in it are straight.
const CELLS: [usize; 2] = [180, 60];
/// Share of each axis that lies outside the valid range.
const MARGIN: f64 = 0.06;
/// A range narrower than this share of its value, or than this angle, is widened to be visible.
const MIN_RANGE_SHARE: f64 = 0.04;
const MIN_RANGE_DEG: f64 = 2.0;
/// Preferred height of the labels, on their lines, and least distance between them (shares of the map) ...
const LABEL_HEIGHT: f64 = 0.3;
const LABELS_APART: [f64; 2] = [0.08, 0.06];
/// ... and from the sides of the map.
const LABEL_INSET: f64 = 0.02;

/// Map of the fitted sigma, drawn only near measured cells.
pub fn sigma_map(table: &SigmaTable, model: &SigmaModel, names: &[&str]) -> Chart {
    let z = at_least(model.domain.z_m, MIN_RANGE_SHARE * model.domain.z_m[1]);
    let theta = at_least(model.domain.theta_rad.map(f64::to_degrees), MIN_RANGE_DEG);
    let below = theta[0].min(0.0);
    let theta = theta.map(|t| t - below);
    let grid = Grid::sample([z, theta], &|z_m, deg| MM * model.sigma(z_m, deg.to_radians()));
    let [low, high] = range(grid.value.iter().copied());
    let scale = Axis::log(low, high);
    let axes = [Axis::with_margin(z, MARGIN), Axis::with_margin(theta, MARGIN).ticks_from(0.0)];
    let labels = ["distance z (m)", "tilt θ (degrees)"];
    let mut chart = Chart { grid: false, ..Chart::new("σ over distance and tilt", axes, labels) };
    chart.layers.push(Layer::Hatching);
    let near = |z_m: f64, deg: f64| is_measured(&table.rows, z_m, deg.to_radians());
    chart
        .layers
        .extend(grid.tiles(&|[z, deg], sigma| near(z, deg).then(|| shade(scale.share(sigma)))));
    let corners = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]].map(|[i, j]| [z[i], theta[j]]);
    chart.layers.push(Layer::Line(corners.to_vec(), Stroke::new(INK, 1)));
    let measured = Mark { edge: WHITE.into(), ..Mark::dot(INK, 2) };
    let place = |r: &SigmaRow| [r.z_m, r.theta_rad.to_degrees()];
    chart.layers.push(Layer::Marks(table.rows.iter().map(place).collect(), measured));
    chart.tips = table.rows.iter().map(|r| (place(r), tip(r, names))).collect();
    chart.layers.extend(grid.iso_lines(&scale.ticks, &|[z, deg]| near(z, deg)));
    let colours = (0..SHADES).map(colour).collect();
    chart.scale = Some(ColourScale { title: "σ (mm)".into(), axis: scale, colours });
    chart.legend = vec![
        Entry::new([Sample::Mark(measured)], "measured"),
        Entry::new([Sample::Hatching], "not measured"),
    ];
    chart
}

fn at_least([low, high]: [f64; 2], width: f64) -> [f64; 2] {
    let spare = (0.5 * (width - (high - low))).max(0.0);
    [low - spare, high + spare]
}

fn shade(share: f64) -> usize {
    ((share * SHADES as f64).max(0.0) as usize).min(SHADES - 1)
}

fn colour(shade: usize) -> RGBColor {
    colours::between(&colours::SURFACE, (shade as f64 + 0.5) / SHADES as f64)
}

type Point = [f64; 2];

/// A surface sampled at the corners of a lattice.
struct Grid {
    x: Vec<f64>,
    y: Vec<f64>,
    /// Row-major, `x` fastest.
    value: Vec<f64>,
}

impl Grid {
    /// Samples denser towards the upper end of `y`, where the forms bend to their poles.
    fn sample([x, y]: [[f64; 2]; 2], f: &dyn Fn(f64, f64) -> f64) -> Self {
        let along = |[low, high]: [f64; 2], n: usize, share: fn(f64) -> f64| -> Vec<f64> {
            (0..=n).map(|i| low + (high - low) * share(i as f64 / n as f64)).collect()
        };
        let (x, y) = (along(x, CELLS[0], |s| s), along(y, CELLS[1], |s| s * (2.0 - s)));
        let value = y.iter().flat_map(|&v| x.iter().map(move |&u| f(u, v))).collect();
        Grid { x, y, value }
    }

    /// Corners of a cell in order, each with its value.
    fn corners(&self, i: usize, j: usize) -> [(Point, f64); 4] {
        [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            .map(|(i, j)| ([self.x[i], self.y[j]], self.value[j * self.x.len() + i]))
    }

    /// Tiles of every row, split where the shade of the cells' means changes; cells without a shade are left
    /// out.
    fn tiles(&self, shade: &dyn Fn(Point, f64) -> Option<usize>) -> Vec<Layer> {
        let mut tiles = Vec::new();
        for j in 0..CELLS[1] {
            let of = |i| {
                let corners = self.corners(i, j);
                let mean = |f: fn(&(Point, f64)) -> f64| corners.iter().map(f).sum::<f64>() / 4.0;
                shade([mean(|c| c.0[0]), mean(|c| c.0[1])], mean(|c| c.1))
            };
            let shades: Vec<Option<usize>> = (0..CELLS[0]).map(of).collect();
            let mut end = 0;
            for run in shades.chunk_by(|a, b| a == b) {
                let x = [self.x[end], self.x[end + run.len()]];
                end += run.len();
                if let Some(shade) = run[0] {
                    tiles.push(Layer::Tile(x, [self.y[j], self.y[j + 1]], colour(shade).into()));
                }
            }
        }
        tiles
    }

    /// Iso-lines by marching squares, with their labels on top.
    fn iso_lines(&self, levels: &[f64], shown: &dyn Fn(Point) -> bool) -> Vec<Layer> {
        let (mut layers, mut labels) = (Vec::new(), Vec::<(Point, f64)>::new());
        for &level in levels {
            let mut pieces = self.pieces(level);
            pieces.retain(|[start, end]| shown(*start) && shown(*end));
            labels.extend(self.label_place(&pieces, &labels).map(|at| (at, level)));
            let line = |ends: &[Point; 2]| Layer::Line(ends.to_vec(), Stroke::new(INK, 1));
            layers.extend(pieces.iter().map(line));
        }
        layers.extend(labels.into_iter().map(|(at, v)| Layer::Label(at, Axis::label(v))));
        layers
    }

    fn pieces(&self, level: f64) -> Vec<[Point; 2]> {
        let cells = (0..CELLS[1]).flat_map(|j| (0..CELLS[0]).map(move |i| (i, j)));
        let pieces = cells.flat_map(|(i, j)| {
            let crossings = crossings(&self.corners(i, j), level);
            crossings.chunks_exact(2).map(|p| [p[0], p[1]]).collect::<Vec<_>>()
        });
        pieces.collect()
    }

    fn label_place(&self, pieces: &[[Point; 2]], taken: &[(Point, f64)]) -> Option<Point> {
        let along = |axis: &[f64], v: f64| (v - axis[0]) / (axis[axis.len() - 1] - axis[0]);
        let share = |p: Point| [along(&self.x, p[0]), along(&self.y, p[1])];
        let free = |p: &Point| {
            let here = share(*p);
            let apart =
                |there: [f64; 2]| (0..2).any(|k| (here[k] - there[k]).abs() > LABELS_APART[k]);
            here.iter().all(|s| (LABEL_INSET..=1.0 - LABEL_INSET).contains(s))
                && taken.iter().all(|(at, _)| apart(share(*at)))
        };
        let off = |p: &Point| (share(*p)[1] - LABEL_HEIGHT).abs();
        let starts = pieces.iter().map(|[start, _]| *start);
        starts.filter(free).min_by(|a, b| off(a).total_cmp(&off(b)))
    }
}

/// Points where the level crosses the sides of a cell: none, two, or four at a saddle.
fn crossings(corners: &[(Point, f64); 4], level: f64) -> Vec<Point> {
    let crossing = |k: usize| {
        let ((p, a), (q, b)) = (corners[k], corners[(k + 1) % 4]);
        let share = (level - a) / (b - a);
        ((a < level) != (b < level)).then(|| [0, 1].map(|i| p[i] + share * (q[i] - p[i])))
    };
    (0..4).filter_map(crossing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Domain, Form};

    fn cell(z_m: f64, theta_rad: f64, sigma_m: f64) -> SigmaRow {
        SigmaRow { z_m, theta_rad, sigma_m, n_effective: None, view: 0 }
    }

    #[test]
    fn the_papers_surface_has_labelled_lines() {
        let mut model = SigmaModel::paper();
        model.domain.theta_rad[1] = 1.33;
        let rows: Vec<SigmaRow> = (1..=4)
            .flat_map(|z| {
                [0.0, 0.15, 0.9].map(|t| cell(f64::from(z), t, model.sigma(f64::from(z), t)))
            })
            .collect();
        let map = sigma_map(&SigmaTable { rows }, &model, &["a"]);
        let gap = |l: &Layer| matches!(l, Layer::Tile([z, _], [t, _], _) if *z < 2.0 && (25.0..40.0).contains(t));
        assert!(!map.layers.iter().any(gap), "nothing was measured there");
        assert!(map.tips.len() == 12 && map.tips[0].1.contains("a: z 1.000 m"));
        let labels = map.layers.iter().filter(|l| matches!(l, Layer::Label(..)));
        assert!(labels.count() >= 4);
        assert!(map.svg().unwrap().contains("σ (mm)"));
    }

    #[test]
    fn tiles_cover_the_map_once() {
        let grid = Grid::sample([[1.0, 3.0], [0.0, 70.0]], &|z, theta| 9.0 * z + theta / 10.0);
        let tiles = grid.tiles(&|_, value| Some(value as usize));
        assert!(tiles.len() > CELLS[1] && tiles.len() < CELLS[0] * CELLS[1] / 4);
        let area = |tile: &Layer| match tile {
            Layer::Tile(z, theta, _) => (z[1] - z[0]) * (theta[1] - theta[0]),
            _ => 0.0,
        };
        let covered: f64 = tiles.iter().map(area).sum();
        approx::assert_relative_eq!(covered, 140.0, max_relative = 1e-9);
    }

    #[test]
    fn a_circle_is_found() {
        let grid = Grid::sample([[-1.1, 1.1]; 2], &|x, y| x.hypot(y));
        let pieces = grid.pieces(1.0);
        assert!(pieces.len() > 100 && grid.pieces(5.0).is_empty());
        for [p, q] in &pieces {
            approx::assert_abs_diff_eq!(p[0].hypot(p[1]), 1.0, epsilon = 1e-3);
            assert!((p[0] - q[0]).hypot(p[1] - q[1]) < 0.1);
        }
        let layers = grid.iso_lines(&[1.0, 5.0], &|_| true);
        assert_eq!(layers.len(), pieces.len() + 1, "one label, and none for an empty line");
    }

    #[test]
    fn a_flat_or_pointlike_surface_still_draws() {
        let domain = Domain { z_m: [2.0, 2.0], theta_rad: [0.0, 0.0] };
        let model = SigmaModel::published(Form::Khoshelham, &[1.4e-3], domain);
        let map = sigma_map(&SigmaTable::default(), &model, &[]);
        for axis in [&map.x, &map.y, &map.scale.as_ref().unwrap().axis] {
            assert!(axis.low.is_finite() && axis.high > axis.low, "{axis:?}");
        }
        assert!(map.svg().is_ok());
    }
}
