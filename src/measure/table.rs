//! Tables of sigma: what a model is fitted to.

use super::{Cell, ViewMeasurement};

/// Which standard deviation a model is fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SigmaKind {
    /// Over the pixels of one frame, along the optical axis: the default.
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
    /// For messages and provenance.
    pub fn description(self) -> &'static str {
        match self {
            SigmaKind::Spatial => "spatial sigma of one frame, along the optical axis",
            SigmaKind::Temporal => "temporal sigma of a pixel, along the optical axis",
            SigmaKind::Total => "total sigma over pixels and frames, along the optical axis",
            SigmaKind::Paper => "the paper's sigma: point-to-plane distances of RANSAC inliers",
        }
    }
}

/// One measured sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SigmaRow {
    /// Mean depth of the samples, m.
    pub z_m: f64,
    /// Tilt of the plane, rad.
    pub theta_rad: f64,
    /// The standard deviation, m.
    pub sigma_m: f64,
    /// Independent samples behind it; `None` when the table does not say.
    pub n_effective: Option<f64>,
    /// Rows of one view share the view's errors.
    pub view: usize,
}

impl SigmaRow {
    /// Standard error from the sample size alone, m.
    pub fn std_error_m(&self) -> Option<f64> {
        self.n_effective.map(|n| self.sigma_m / (2.0 * n).sqrt())
    }
}

/// What a model is fitted to.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SigmaTable {
    /// In any order.
    pub rows: Vec<SigmaRow>,
}

impl SigmaTable {
    /// The chosen sigma of every cell of every view.
    pub fn of(views: &[ViewMeasurement], kind: SigmaKind) -> Self {
        let rows = views.iter().enumerate().flat_map(|(view, m)| rows_of(view, m, kind)).collect();
        SigmaTable { rows }
    }

    /// Number of different views.
    pub fn views(&self) -> usize {
        let mut seen: Vec<usize> = self.rows.iter().map(|r| r.view).collect();
        seen.sort_unstable();
        seen.dedup();
        seen.len()
    }

    /// Least and greatest of a column.
    pub fn range(&self, column: impl Fn(&SigmaRow) -> f64) -> [f64; 2] {
        crate::stats::range(self.rows.iter().map(column))
    }
}

fn rows_of(view: usize, m: &ViewMeasurement, kind: SigmaKind) -> Vec<SigmaRow> {
    if kind == SigmaKind::Paper {
        return m
            .paper
            .iter()
            .map(|p| SigmaRow {
                z_m: p.z_m,
                theta_rad: p.theta_rad,
                sigma_m: p.sigma_m,
                n_effective: Some((p.inliers as f64 / m.correlation.sum_of_squares).max(1.0)),
                view,
            })
            .collect();
    }
    let sigma = |cell: &Cell| match kind {
        SigmaKind::Temporal => cell.spread.temporal_m,
        SigmaKind::Total => Some(cell.spread.total_m),
        SigmaKind::Spatial | SigmaKind::Paper => Some(cell.spread.spatial_m),
    };
    m.cells
        .iter()
        .filter_map(|cell| {
            let sigma_m = sigma(cell).filter(|s| *s > 0.0)?;
            let n_effective = match kind {
                SigmaKind::Temporal => cell.n_effective_temporal,
                _ => cell.n_effective,
            };
            Some(SigmaRow {
                z_m: cell.z_m,
                theta_rad: m.theta_rad,
                sigma_m,
                n_effective: Some(n_effective),
                view,
            })
        })
        .collect()
}
