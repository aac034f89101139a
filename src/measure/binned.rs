//! Pools neighbouring rows of a table that is too long for a fit.

use std::collections::BTreeMap;

use super::table::{SigmaRow, SigmaTable};
use crate::units::counted;

/// A fit of this many rows takes ten seconds, and of four times as many a hundred.
pub const MAX_ROWS: usize = 10_000;

impl SigmaTable {
    /// The table itself, or where it has more than `MAX_ROWS` rows one of at most that many, and a remark.
    /// Rows of one view that are similar in distance and tilt are pooled into one of their mean variance.
    /// With more views than `MAX_ROWS`, views are pooled too.
    pub fn binned(&self) -> (SigmaTable, Option<String>) {
        let n = self.rows.len();
        if n <= MAX_ROWS {
            return (self.clone(), None);
        }
        // 100 x 100 cells, fewer where there are many views. Where most views are single rows, which
        // share no errors with others, rows are pooled regardless of the view.
        let views = 1 + self.rows.iter().map(|r| r.view).max().unwrap_or(0);
        let by_view = 2 * views < n && views <= MAX_ROWS;
        let mut side = 100;
        let mut cells = self.cells(side, by_view);
        while cells.len() > MAX_ROWS && side > 1 {
            side /= 2;
            cells = self.cells(side, by_view);
        }
        let pooled = cells.values().enumerate();
        let rows: Vec<SigmaRow> =
            pooled.map(|(k, rows)| pool(rows, if by_view { rows[0].view } else { k })).collect();
        let remark = format!(
            "{} were pooled by distance and tilt into {}, for a fit of more than {MAX_ROWS} takes too long",
            counted(n, "row"),
            rows.len()
        );
        (SigmaTable { rows }, Some(remark))
    }

    /// Groups rows by view, and by steps in the logarithm of the distance and in the tilt.
    fn cells(&self, side: usize, by_view: bool) -> BTreeMap<[usize; 3], Vec<&SigmaRow>> {
        let ends = |of: fn(&SigmaRow) -> f64| crate::stats::range(self.rows.iter().map(of));
        let (z, theta) = (ends(|r| r.z_m.ln()), ends(|r| r.theta_rad));
        let step = |v: f64, [low, high]: [f64; 2]| {
            let share = if high > low { (v - low) / (high - low) } else { 0.0 };
            ((share * side as f64) as usize).min(side - 1)
        };
        let mut cells: BTreeMap<[usize; 3], Vec<&SigmaRow>> = BTreeMap::new();
        for row in &self.rows {
            let view = if by_view { row.view } else { 0 };
            let key = [view, step(row.z_m.ln(), z), step(row.theta_rad, theta)];
            cells.entry(key).or_default().push(row);
        }
        cells
    }
}

/// Mean of rows, weighted by their samples.
fn pool(rows: &[&SigmaRow], view: usize) -> SigmaRow {
    let weight = |r: &SigmaRow| r.n_effective.unwrap_or(1.0);
    let all: f64 = rows.iter().map(|r| weight(r)).sum();
    let mean = |of: fn(&SigmaRow) -> f64| rows.iter().map(|r| weight(r) * of(r)).sum::<f64>() / all;
    SigmaRow {
        z_m: mean(|r| r.z_m),
        theta_rad: mean(|r| r.theta_rad),
        sigma_m: mean(|r| r.sigma_m * r.sigma_m).sqrt(),
        n_effective: rows.iter().map(|r| r.n_effective).sum(),
        view,
    }
}
