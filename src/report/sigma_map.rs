//! Sigma over distance and tilt, as a map with iso-lines and the cells that were measured.

mod draw;
mod isolines;

use super::axis::Axis;
use super::sheet;
use crate::error::Result;
use crate::measure::SigmaTable;
use crate::model::SigmaModel;

/// A stretch of the map of one shade.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// From and to, m.
    pub z_m: [f64; 2],
    /// From and to, degrees.
    pub theta_deg: [f64; 2],
    /// 0 is the least sigma, [`SigmaMap::SHADES`] - 1 the greatest.
    pub shade: usize,
}

/// Where sigma has one value.
#[derive(Debug, Clone, PartialEq)]
pub struct IsoLine {
    /// That value, mm.
    pub sigma_mm: f64,
    /// Ends of straight pieces: z (m), theta (degrees).
    pub pieces: Vec<[[f64; 2]; 2]>,
    /// Where its label stands.
    pub label_at: Option<[f64; 2]>,
}

/// Everything the map shows.
#[derive(Debug, Clone, PartialEq)]
pub struct SigmaMap {
    /// Above the map.
    pub title: String,
    /// Distance, m.
    pub x: Axis,
    /// Tilt, degrees.
    pub y: Axis,
    /// Colour, mm, logarithmic.
    pub sigma_mm: Axis,
    /// Distances where the model is valid, m.
    pub valid_z_m: [f64; 2],
    /// Tilts where it is, degrees.
    pub valid_theta_deg: [f64; 2],
    /// The coloured surface.
    pub runs: Vec<Run>,
    /// At the colour scale's ticks.
    pub lines: Vec<IsoLine>,
    /// The measured cells: z (m), theta (degrees).
    pub cells: Vec<[f64; 2]>,
}

/// Cells of the coloured map; between rows the shade steps, too little to be seen.
const ROWS: usize = 72;
const COLUMNS: usize = 240;
/// Cells in which iso-lines are straight.
const LINE_CELLS: [usize; 2] = [120, 60];
/// Share of each axis that shows what lies outside the valid range.
const MARGIN: f64 = 0.06;
/// A range narrower than this share of its value, or than this angle, is widened to be seen.
const NARROWEST_SHARE: f64 = 0.04;
const NARROWEST_DEG: f64 = 2.0;
const MM: f64 = 1e3;

impl SigmaMap {
    /// Steps of colour: fine enough to look continuous.
    pub const SHADES: usize = 36;

    /// Works out all that is drawn.
    pub fn of(table: &SigmaTable, model: &SigmaModel) -> Self {
        let z = at_least(model.domain.z_m, NARROWEST_SHARE * model.domain.z_m[1]);
        let theta = at_least(model.domain.theta_rad.map(f64::to_degrees), NARROWEST_DEG);
        let below = theta[0].min(0.0);
        let theta = theta.map(|t| t - below);
        let sigma = |z_m: f64, theta_deg: f64| MM * model.sigma(z_m, theta_deg.to_radians());
        let grid = isolines::Grid::sample(z, theta, LINE_CELLS, &sigma);
        let [least, greatest] = grid.range();
        let scale = Axis::log(least, greatest);
        SigmaMap {
            title: "σ over distance and tilt".into(),
            x: with_margin(z),
            y: with_margin(theta).ticks_from(0.0),
            valid_z_m: z,
            valid_theta_deg: theta,
            runs: runs(z, theta, &scale, &sigma),
            lines: isolines::lines(&grid, &scale.ticks),
            cells: table.rows.iter().map(|r| [r.z_m, r.theta_rad.to_degrees()]).collect(),
            sigma_mm: scale,
        }
    }

    /// As SVG text.
    ///
    /// # Errors
    /// When plotters fails.
    pub fn svg(&self) -> Result<String> {
        sheet::svg(self)
    }

    /// As the bytes of a PNG.
    ///
    /// # Errors
    /// When plotters or the PNG encoder fails.
    pub fn png(&self) -> Result<Vec<u8>> {
        sheet::png(self)
    }
}

fn at_least([low, high]: [f64; 2], width: f64) -> [f64; 2] {
    let spare = (0.5 * (width - (high - low))).max(0.0);
    [low - spare, high + spare]
}

fn with_margin([low, high]: [f64; 2]) -> Axis {
    let spare = MARGIN * (high - low);
    Axis::linear(low - spare, high + spare)
}

/// Rows of tilt, cut where the shade changes; runs that go on in the next row are one.
fn runs(z: [f64; 2], theta: [f64; 2], scale: &Axis, sigma: &dyn Fn(f64, f64) -> f64) -> Vec<Run> {
    let (mut done, mut open) = (Vec::new(), Vec::<Run>::new());
    for i in 0..ROWS {
        let theta_deg = [i, i + 1].map(|i| along(theta, i, ROWS));
        let middle = 0.5 * (theta_deg[0] + theta_deg[1]);
        let mut row = shades(z, |z_m| shade(scale.share(sigma(z_m, middle))), theta_deg);
        for run in &mut row {
            let same = |b: &Run| b.z_m == run.z_m && b.shade == run.shade;
            if let Some(k) = open.iter().position(same) {
                run.theta_deg[0] = open.swap_remove(k).theta_deg[0];
            }
        }
        done.append(&mut open);
        open = row;
    }
    done.append(&mut open);
    done
}

fn shades(z: [f64; 2], shade: impl Fn(f64) -> usize, theta_deg: [f64; 2]) -> Vec<Run> {
    let mut row: Vec<Run> = Vec::new();
    for i in 0..COLUMNS {
        let z_m = [i, i + 1].map(|i| along(z, i, COLUMNS));
        let shade = shade(0.5 * (z_m[0] + z_m[1]));
        match row.last_mut() {
            Some(last) if last.shade == shade => last.z_m[1] = z_m[1],
            _ => row.push(Run { z_m, theta_deg, shade }),
        }
    }
    row
}

/// Edge `i` of `n` equal parts.
fn along([low, high]: [f64; 2], i: usize, n: usize) -> f64 {
    low + (high - low) * i as f64 / n as f64
}

fn shade(share: f64) -> usize {
    ((share * SigmaMap::SHADES as f64).max(0.0) as usize).min(SigmaMap::SHADES - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Domain, Form};

    #[test]
    fn the_papers_surface_has_labelled_lines() {
        let mut model = SigmaModel::paper();
        model.domain.theta_rad[1] = 1.33;
        let map = SigmaMap::of(&SigmaTable::default(), &model);
        assert!(map.lines.iter().filter(|l| l.label_at.is_some()).count() >= 4);
        let shades = map.runs.iter().map(|r| r.shade);
        assert!(shades.clone().min() == Some(0) && shades.max() > Some(SigmaMap::SHADES / 2));
        let size = |[low, high]: [f64; 2]| high - low;
        let covered: f64 = map.runs.iter().map(|r| size(r.z_m) * size(r.theta_deg)).sum();
        let all = size(map.valid_z_m) * size(map.valid_theta_deg);
        approx::assert_relative_eq!(covered, all, max_relative = 1e-9);
        assert!(map.svg().unwrap().contains("σ (mm)"));
    }

    #[test]
    fn a_flat_or_pointlike_surface_still_draws() {
        let domain = Domain { z_m: [2.0, 2.0], theta_rad: [0.0, 0.0] };
        let model = SigmaModel::published(Form::Khoshelham, &[1.4e-3], domain);
        let map = SigmaMap::of(&SigmaTable::default(), &model);
        for axis in [&map.x, &map.y, &map.sigma_mm] {
            assert!(axis.low.is_finite() && axis.high > axis.low, "{axis:?}");
        }
        assert!(map.svg().is_ok());
    }
}
