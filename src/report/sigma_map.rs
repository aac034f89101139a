//! Sigma over distance and tilt, as a map with iso-lines and the cells that were measured.

mod isolines;

use plotters::style::{RGBColor, WHITE};

use super::axis::Axis;
use super::chart::{Chart, ColourScale, Entry, Layer, Mark, Sample, Stroke};
use super::colours::{self, INK};
use super::numbers::MM;
use crate::measure::SigmaTable;
use crate::model::SigmaModel;

/// Steps of colour: fine enough to look continuous.
const SHADES: usize = 36;
/// Cells of the coloured map; between rows the shade steps, too little to be seen.
const ROWS: usize = 60;
const COLUMNS: usize = 180;
/// Cells in which iso-lines are straight.
const LINE_CELLS: [usize; 2] = [120, 60];
/// Share of each axis that shows what lies outside the valid range.
const MARGIN: f64 = 0.06;
/// A range narrower than this share of its value, or than this angle, is widened to be seen.
const MIN_RANGE_SHARE: f64 = 0.04;
const MIN_RANGE_DEG: f64 = 2.0;

/// The fitted sigma where it is valid.
pub fn sigma_map(table: &SigmaTable, model: &SigmaModel) -> Chart {
    let z = at_least(model.domain.z_m, MIN_RANGE_SHARE * model.domain.z_m[1]);
    let theta = at_least(model.domain.theta_rad.map(f64::to_degrees), MIN_RANGE_DEG);
    let below = theta[0].min(0.0);
    let theta = theta.map(|t| t - below);
    let sigma = |z_m: f64, theta_deg: f64| MM * model.sigma(z_m, theta_deg.to_radians());
    let grid = isolines::Grid::sample(z, theta, LINE_CELLS, &sigma);
    let [low, high] = grid.range();
    let scale = Axis::log(low, high);
    let axes = [Axis::with_margin(z, MARGIN), Axis::with_margin(theta, MARGIN).ticks_from(0.0)];
    let labels = ["distance z (m)", "tilt θ (degrees)"];
    let mut chart = Chart { grid: false, ..Chart::new("σ over distance and tilt", axes, labels) };
    chart.layers.push(Layer::Hatching);
    chart.layers.extend(tiles(z, theta, &|z, theta| shade(scale.share(sigma(z, theta)))));
    let corners = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]].map(|[i, j]| [z[i], theta[j]]);
    chart.layers.push(Layer::Line(corners.to_vec(), Stroke::new(INK, 1)));
    let measured = Mark { edge: WHITE.into(), ..Mark::dot(INK, 2) };
    let cells = table.rows.iter().map(|r| [r.z_m, r.theta_rad.to_degrees()]).collect();
    chart.layers.push(Layer::Marks(cells, measured));
    chart.layers.extend(isolines::layers(&grid, &scale.ticks));
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
    colours::surface((shade as f64 + 0.5) / SHADES as f64)
}

/// Rows of tilt, cut where the shade changes.
fn tiles(z: [f64; 2], theta: [f64; 2], shade: &dyn Fn(f64, f64) -> usize) -> Vec<Layer> {
    let edge = |[low, high]: [f64; 2], i: usize, n: usize| low + (high - low) * i as f64 / n as f64;
    let row = |j: usize| {
        let theta = [j, j + 1].map(|j| edge(theta, j, ROWS));
        let shades: Vec<usize> = (0..2 * COLUMNS)
            .skip(1)
            .step_by(2)
            .map(|i| shade(edge(z, i, 2 * COLUMNS), 0.5 * (theta[0] + theta[1])))
            .collect();
        let mut end = 0;
        let runs = shades.chunk_by(|a, b| a == b).map(|run| {
            let start = end;
            end += run.len();
            Layer::Tile([start, end].map(|i| edge(z, i, COLUMNS)), theta, colour(run[0]).into())
        });
        runs.collect::<Vec<Layer>>()
    };
    (0..ROWS).flat_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Domain, Form};

    #[test]
    fn the_papers_surface_has_labelled_lines() {
        let mut model = SigmaModel::paper();
        model.domain.theta_rad[1] = 1.33;
        let map = sigma_map(&SigmaTable::default(), &model);
        let labels = map.layers.iter().filter(|l| matches!(l, Layer::Label(..)));
        assert!(labels.count() >= 4);
        assert!(map.svg().unwrap().contains("σ (mm)"));
    }

    #[test]
    fn tiles_cover_the_map_once() {
        let tiles = tiles([1.0, 3.0], [0.0, 70.0], &|z, theta| (9.0 * z + theta / 10.0) as usize);
        assert!(tiles.len() > ROWS && tiles.len() < ROWS * COLUMNS / 4);
        let area = |tile: &Layer| match tile {
            Layer::Tile(z, theta, _) => (z[1] - z[0]) * (theta[1] - theta[0]),
            _ => 0.0,
        };
        let covered: f64 = tiles.iter().map(area).sum();
        approx::assert_relative_eq!(covered, 140.0, max_relative = 1e-9);
    }

    #[test]
    fn a_flat_or_pointlike_surface_still_draws() {
        let domain = Domain { z_m: [2.0, 2.0], theta_rad: [0.0, 0.0] };
        let model = SigmaModel::published(Form::Khoshelham, &[1.4e-3], domain);
        let map = sigma_map(&SigmaTable::default(), &model);
        for axis in [&map.x, &map.y, &map.scale.as_ref().unwrap().axis] {
            assert!(axis.low.is_finite() && axis.high > axis.low, "{axis:?}");
        }
        assert!(map.svg().is_ok());
    }
}
