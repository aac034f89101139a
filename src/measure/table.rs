//! Tables of sigma, to which models are fitted; writes measurements.csv and reads tables of any source.

use std::collections::HashMap;
use std::path::Path;

use super::{Cell, ViewMeasurement};
use crate::error::{Error, Result};
use crate::frame::FARTHEST_M;
use crate::plane::RansacPlane;
use crate::read::read_bytes;
use crate::stats::Budget;
use crate::units::shortest;

/// The standard deviation that a model is fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SigmaKind {
    /// Over the pixels of one frame, along the optical axis (the default).
    #[default]
    Spatial,
    /// Of one pixel over time.
    Temporal,
    /// Over pixels and frames.
    Total,
    /// The paper's method: RANSAC inliers of one frame, along the plane's normal.
    Paper,
}

impl SigmaKind {
    /// Name for messages and provenance.
    pub fn description(self) -> &'static str {
        match self {
            SigmaKind::Spatial => "spatial sigma of one frame, along the optical axis",
            SigmaKind::Temporal => "temporal sigma of a pixel, along the optical axis",
            SigmaKind::Total => "total sigma over pixels and frames, along the optical axis",
            SigmaKind::Paper => "the paper's sigma: point-to-plane distances of RANSAC inliers",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SigmaRow {
    /// Mean depth of the samples, m.
    pub z_m: f64,
    pub theta_rad: f64,
    pub sigma_m: f64,
    /// Effective number of independent samples; `None` when the table does not give it.
    pub n_effective: Option<f64>,
    /// Index of the view; its rows share errors.
    pub view: usize,
}

impl SigmaRow {
    /// Standard error from the sample size alone, m.
    pub fn std_error_m(&self) -> Option<f64> {
        self.n_effective.map(|n| self.sigma_m / (2.0 * n).sqrt())
    }
}

/// The data that a model is fitted to.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SigmaTable {
    pub rows: Vec<SigmaRow>,
}

impl SigmaTable {
    /// The chosen sigma of every cell of every view.
    pub fn of(views: &[ViewMeasurement], kind: SigmaKind) -> Self {
        let rows = views.iter().enumerate().flat_map(|(view, m)| rows_of(view, m, kind)).collect();
        SigmaTable { rows }
    }

    pub fn views(&self) -> Vec<usize> {
        let mut seen: Vec<usize> = self.rows.iter().map(|r| r.view).collect();
        seen.sort_unstable();
        seen.dedup();
        seen
    }

    pub fn range(&self, column: impl Fn(&SigmaRow) -> f64) -> [f64; 2] {
        crate::stats::range(self.rows.iter().map(column))
    }
}

fn rows_of(view: usize, m: &ViewMeasurement, kind: SigmaKind) -> Vec<SigmaRow> {
    if kind == SigmaKind::Paper {
        let row = |p: RansacPlane| {
            let n_effective = Some((p.inliers as f64 / m.correlation.sum_of_squares).max(1.0));
            let RansacPlane { z_m, theta_rad, sigma_m, .. } = p;
            SigmaRow { z_m, theta_rad, sigma_m, n_effective, view }
        };
        // Of coarse words the inliers may all be one.
        return m.paper.into_iter().filter(|p| p.sigma_m > 0.0).map(row).collect();
    }
    let row = |cell: &Cell| {
        let (sigma_m, n) = match kind {
            SigmaKind::Temporal => (cell.spread.temporal_m?, cell.n_effective_temporal),
            SigmaKind::Total => (cell.spread.total_m, cell.n_effective),
            SigmaKind::Spatial | SigmaKind::Paper => (cell.spread.spatial_m, cell.n_effective),
        };
        let (z_m, theta_rad, n_effective) = (cell.z_m, m.theta_rad, Some(n));
        (sigma_m > 0.0).then_some(SigmaRow { z_m, theta_rad, sigma_m, n_effective, view })
    };
    m.cells.iter().filter_map(row).collect()
}

/// A column of measurements.csv: its name, and its value for a cell of a view.
type Column = (&'static str, fn(&ViewMeasurement, &Cell) -> String);

/// Programs rely on the names (`crate::docs::layouts`).
const COLUMNS: [Column; 30] = [
    ("view", |m, _| m.name.clone()),
    ("z_m", |_, cell| number(cell.z_m)),
    ("theta_rad", |m, _| number(m.theta_rad)),
    ("azimuth_rad", |m, _| number(m.azimuth_rad)),
    ("sigma_m", |_, cell| number(cell.spread.spatial_m)),
    ("sigma_std_error_m", |_, cell| number(cell.std_error_m)),
    ("sigma_temporal_m", |_, cell| optional(cell.spread.temporal_m)),
    ("n", |_, cell| cell.n.to_string()),
    ("n_effective", |_, cell| number(cell.n_effective)),
    ("sigma_total_m", |_, cell| number(cell.spread.total_m)),
    ("sigma_perpendicular_m", |_, cell| number(cell.spread.perpendicular_m)),
    ("missing", |_, cell| cell.dropouts.to_string()),
    ("cut", |_, cell| cell.cut.to_string()),
    ("view_z_m", |m, _| number(m.z_m)),
    ("view_sigma_m", |m, _| number(m.whole.spread.spatial_m)),
    ("axis_distance_m", |m, _| number(m.axis_distance_m)),
    ("reference_distance_m", |m, _| optional(m.reference_distance_m)),
    ("paper_z_m", |m, _| optional(m.paper.map(|p| p.z_m))),
    ("paper_theta_rad", |m, _| optional(m.paper.map(|p| p.theta_rad))),
    ("paper_sigma_m", |m, _| optional(m.paper.map(|p| p.sigma_m))),
    ("correlation_px", |m, _| number(m.correlation.sum_of_squares.sqrt())),
    ("temporal_correlation", |m, _| optional(m.temporal_correlation)),
    ("infrared", |m, _| optional(m.infrared)),
    ("time_s", |m, _| number(m.time_s)),
    ("sigma_px", |m, cell| optional(m.sigma_px(cell))),
    ("axis_std_error_m", |m, _| number(m.axis_std_error_m)),
    ("reference_uncertainty_m", |m, _| optional(m.reference_uncertainty_m)),
    ("distance_error_uncertainty_m", |m, _| of_budget(m, |b| Some(b.combined_m))),
    ("distance_error_degrees_of_freedom", |m, _| of_budget(m, |b| b.degrees_of_freedom)),
    ("distance_error_expanded_m", |m, _| of_budget(m, |b| Some(b.expanded_m))),
];

/// Text of measurements.csv: one row per cell, in SI units, empty where a statistic is not available.
pub fn write_measurements(views: &[ViewMeasurement]) -> String {
    // Writing to memory does not fail.
    // A name that begins like a comment is quoted.
    let mut table = ::csv::WriterBuilder::new().comment(Some(b'#')).from_writer(Vec::new());
    let _ = table.write_record(COLUMNS.map(|(name, _)| name));
    for (m, cell) in views.iter().flat_map(|m| m.cells.iter().map(move |cell| (m, cell))) {
        let _ = table.write_record(COLUMNS.map(|(_, value)| value(m, cell)));
    }
    String::from_utf8(table.into_inner().unwrap_or_default()).unwrap_or_default()
}

/// Shortest text that parses back to the same number; empty where it is not finite.
fn number(v: f64) -> String {
    if v.is_finite() { shortest(v) } else { String::new() }
}

fn optional(v: Option<f64>) -> String {
    v.map_or_else(String::new, number)
}

fn of_budget(m: &ViewMeasurement, of: impl Fn(&Budget) -> Option<f64>) -> String {
    optional(m.distance_budget.as_ref().and_then(of))
}

const REMEDY_TABLE: &str = "the header is z_m,theta_rad,sigma_m and optionally n, SI units";

/// Reads `z_m,theta_rad,sigma_m[,n]` (in any order, other columns ignored). With a column `view`, rows of
/// the same name count as one view; a column `n_effective` is preferred to `n`.
/// Fails when a column is missing or a value is not a usable number; the message names the line.
pub fn read_table(path: &Path) -> Result<SigmaTable> {
    let text = read_bytes(path)?;
    let wrong = |line: usize, what: String| Error::text(path, line, what, REMEDY_TABLE);
    let damaged = |e: ::csv::Error| {
        let line = e.position().map_or(1, |p| p.line() as usize);
        match e.into_kind() {
            ::csv::ErrorKind::Io(cause) => Error::read(path, cause),
            ::csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                wrong(line, format!("{len} cells, the header has {expected_len}"))
            }
            ::csv::ErrorKind::Utf8 { .. } => wrong(line, "this is not text".into()),
            _ => wrong(line, "this is not a line of a table".into()),
        }
    };
    let mut reader =
        ::csv::ReaderBuilder::new().trim(::csv::Trim::All).comment(Some(b'#')).from_reader(&*text);
    let headers = reader.headers().map_err(damaged)?.clone();
    let find = |name: &str| headers.iter().position(|h| h.trim_start_matches('\u{feff}') == name);
    let need =
        |name: &str| find(name).ok_or_else(|| wrong(1, format!("there is no column {name}")));
    let columns = [need("z_m")?, need("theta_rad")?, need("sigma_m")?];
    let count = find("n_effective").or_else(|| find("n"));
    let view = find("view");
    let mut names: HashMap<String, usize> = HashMap::new();
    let mut table = SigmaTable::default();
    for record in reader.records() {
        let record = record.map_err(damaged)?;
        let line = record.position().map_or(0, |p| p.line() as usize);
        let text = |column: usize| record.get(column).unwrap_or("").to_string();
        let value = |column: usize| -> Result<f64> {
            let text = text(column);
            text.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
                wrong(line, format!("{} = \"{text}\" is not a number", &headers[column]))
            })
        };
        let [z_m, theta_rad, sigma_m] =
            [value(columns[0])?, value(columns[1])?, value(columns[2])?];
        check(z_m, theta_rad, sigma_m).map_err(|what| wrong(line, what))?;
        let n_effective = match count {
            Some(column) if !text(column).is_empty() => Some(value(column)?)
                .filter(|n| *n >= 1.0)
                .ok_or_else(|| wrong(line, "n is below 1".into()))?
                .into(),
            _ => None,
        };
        let view = match view {
            Some(column) => {
                let next = names.len();
                *names.entry(text(column)).or_insert(next)
            }
            None => table.rows.len(),
        };
        table.rows.push(SigmaRow { z_m, theta_rad, sigma_m, n_effective, view });
    }
    let counted = table.rows.iter().filter(|r| r.n_effective.is_some()).count();
    if counted != 0 && counted != table.rows.len() {
        return Err(wrong(0, "n is given in some rows and missing in others".into()));
    }
    Ok(table)
}

fn check(z_m: f64, theta_rad: f64, sigma_m: f64) -> Result<(), String> {
    let wrong = |name: &str, v: f64, why: &str| Err(format!("{name} = {} {why}", shortest(v)));
    match (z_m, theta_rad, sigma_m) {
        (z, ..) if z <= 0.0 => wrong("z_m", z, "must be positive"),
        (z, ..) if z >= FARTHEST_M => {
            wrong("z_m", z, "is farther than any such sensor sees; is it in millimetres?")
        }
        (_, theta, _) if !(0.0..std::f64::consts::FRAC_PI_2).contains(&theta) => {
            wrong("theta_rad", theta, "must lie in [0, pi/2); is it in degrees?")
        }
        (.., s) if s <= 0.0 => wrong("sigma_m", s, "must be positive"),
        (.., s) if s >= FARTHEST_M => {
            wrong("sigma_m", s, "is no depth noise; is it in millimetres?")
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_in_any_order_with_views() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("table.csv");
        let text = "n,view,theta_rad,z_m,sigma_m\n100,a,0.1,1.0,0.002\n50,a,0.1,1.1,0.0021\n9,b,0,2,0.006\n";
        std::fs::write(&path, text).unwrap();
        let table = read_table(&path).unwrap();
        assert_eq!(table.rows.len(), 3);
        assert_eq!(table.views().len(), 2);
        assert_eq!(table.rows[1].n_effective, Some(50.0));
    }
}
