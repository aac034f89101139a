//! Where (z, tilt) was measured; a curve or a colour elsewhere would be a guess.

use crate::measure::SigmaRow;

/// A measured cell covers its neighbourhood up to one step of the paper's grid: 0.5 m from 1 m on, and 10
/// degrees.
const STEP_RATIO: f64 = 1.5;
const STEP_RAD: f64 = 10f64.to_radians();

/// Whether a measured cell is near.
pub(super) fn is_measured(rows: &[SigmaRow], z_m: f64, theta_rad: f64) -> bool {
    rows.iter().any(|row| {
        let along = (z_m / row.z_m).ln() / STEP_RATIO.ln();
        along.hypot((theta_rad - row.theta_rad) / STEP_RAD) <= 1.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_stands_for_its_neighbours_in_the_papers_grid() {
        let cell = |z_m, tilt: f64| SigmaRow {
            z_m,
            theta_rad: tilt.to_radians(),
            sigma_m: 1e-3,
            n_effective: None,
            view: 0,
        };
        let rows = [cell(1.0, 0.0), cell(1.0, 50.0)];
        for (z_m, tilt, expected) in [
            (1.49, 0.0, true),
            (1.0, 9.9, true),
            (1.4, 9.0, false),
            (1.0, 30.0, false),
            (1.6, 0.0, false),
        ] {
            assert_eq!(is_measured(&rows, z_m, f64::to_radians(tilt)), expected, "{z_m} {tilt}");
        }
    }
}
