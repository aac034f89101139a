//! Candidates for changes of the noise: terms of the log variance.

use super::candidate::{Candidate, RECALIBRATE};
use crate::camera::Camera;
use crate::effects::Bounds;
use crate::model::SigmaModel;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Coordinate, Extent, Modulation, Statistic, TABLE, Term};

/// Candidates from the catalogue, changes of sigma itself, and nameless curves.
pub fn candidates(bounds: &Bounds, sigma: &SigmaModel) -> Vec<Candidate> {
    let mut all = Candidate::of_catalogue(Statistic::Variance, bounds);
    all.push(Candidate::named(RECALIBRATE, Basis::Level));
    all.extend(recalibrations(bounds.reach, sigma));
    all.extend(surfaces(bounds.reach));
    all.extend(curves(bounds.camera, bounds.reach));
    let matches = bounds.kind.is_none_or(SensorKind::has_disparity);
    all.retain(|c| matches || !c.is_of_disparity());
    all
}

/// Whether it says more than a sigma over depth and tilt can. Where sigma was fitted to the same views,
/// what depends on these two alone is the form of sigma, not physics.
pub fn beyond_sigma(candidate: &Candidate) -> bool {
    !candidate.basis.is_of_sigma()
}

/// Free refit of sigma's level and form. Where noise across the plane is added to noise along the axis, one of them
/// the larger from some distance on, each function of the tilt changes with the distance as a cubic, nearly.
pub fn refit(reach: &Extent) -> Candidate {
    surface(reach, &|l, t| {
        let u = steepness(t);
        let w = t * t;
        let level = [1.0, l, l * l, l.powi(3), l.powi(4)];
        let tilt = [u, w, u * u].map(|t| [t, t * l, t * l * l, t * l.powi(3)]);
        level.into_iter().chain(tilt.into_iter().flatten()).collect()
    })
}

/// Free surfaces over depth and tilt, from few columns to many. A family that depends only on these two
/// must explain more than any of them.
pub fn surfaces(reach: &Extent) -> Vec<Candidate> {
    vec![
        surface(reach, &|l, _| vec![1.0, l, l * l]),
        surface(reach, &|_, t| vec![1.0, steepness(t)]),
        surface(reach, &|l, t| vec![1.0, l, l * l, steepness(t), t * t]),
        surface(reach, &|l, t| {
            let u = steepness(t);
            vec![1.0, l, l * l, l.powi(3), u, t * t, u * l, t * t * l]
        }),
        refit(reach),
    ]
}

/// 2 ln(1 / cos(theta)): the excess of log variance along the axis over that across the plane.
fn steepness(theta: f64) -> f64 {
    -2.0 * theta.cos().max(0.05).ln()
}

/// Change of sigma with these columns over log depth (-1 to 1 over the reach) and tilt.
fn surface(reach: &Extent, columns: &dyn Fn(f64, f64) -> Vec<f64>) -> Candidate {
    let (z_m, theta_rad) = table_reach(reach);
    let log = z_m.map(f64::ln);
    let rows: Vec<Vec<f64>> = (0..TABLE * TABLE)
        .map(|n| {
            let (z, theta) = table_place(z_m, theta_rad, n);
            let share = (z.ln() - log[0]) / (log[1] - log[0]).max(1e-9);
            columns(2.0 * share - 1.0, theta)
        })
        .collect();
    let columns = (0..rows[0].len()).map(|j| rows.iter().map(|row| row[j]).collect()).collect();
    Candidate::named(RECALIBRATE, Basis::Table { z_m, theta_rad, columns })
}

/// Depth and tilt range of a table of sigma's changes; never empty.
fn table_reach(reach: &Extent) -> ([f64; 2], [f64; 2]) {
    let wide = |[low, high]: [f64; 2]| [low, high.max(low + 1e-3)];
    (wide(reach.z), wide(reach.theta))
}

/// Depth and tilt of a table's entry number `n`.
fn table_place(z_m: [f64; 2], theta_rad: [f64; 2], n: usize) -> (f64, f64) {
    let at = |[low, high]: [f64; 2], k: usize| low + (high - low) * k as f64 / (TABLE - 1) as f64;
    (at(z_m, n % TABLE), at(theta_rad, n / TABLE))
}

/// Table of the model's log variance.
fn log_variances(model: &SigmaModel, z_m: [f64; 2], theta_rad: [f64; 2]) -> Vec<f64> {
    let log = |n| {
        let (z, theta) = table_place(z_m, theta_rad, n);
        2.0 * model.sigma(z, theta).ln()
    };
    (0..TABLE * TABLE).map(log).collect()
}

/// Cap on sigma's standard error: a factor of e in variance. A calibration with larger errors, or one
/// edited by hand, would match anything.
const UNSURE: f64 = 1.0;

/// Error of the log variance by sigma's own covariance: one term per eigenvector, at one standard
/// deviation.
pub fn error_of_sigma(reach: &Extent, sigma: &SigmaModel) -> Vec<Vec<Term>> {
    let (z_m, theta_rad) = table_reach(reach);
    let table = |model: &SigmaModel| log_variances(model, z_m, theta_rad);
    let eigen = sigma.covariance.clone().symmetric_eigen();
    let direction = |k: usize| {
        let root = eigen.eigenvalues[k].max(0.0).sqrt();
        let moved = |share: f64| {
            let mut model = sigma.clone();
            let by = eigen.eigenvectors.column(k) * (share * root);
            model.parameters.iter_mut().zip(by.iter()).for_each(|(p, d)| *p += d);
            table(&model)
        };
        // Central difference over a hundredth of a standard deviation, as sigma is not linear.
        const SMALL: f64 = 0.01;
        let (up, down) = (moved(SMALL), moved(-SMALL));
        let slope = |(u, d): (&f64, &f64)| ((u - d) / (2.0 * SMALL)).clamp(-UNSURE, UNSURE);
        let column: Vec<f64> = up.iter().zip(&down).map(slope).collect();
        let told = column.iter().all(|c| c.is_finite()) && column.iter().any(|c| c.abs() > 1e-4);
        told.then(|| {
            let basis = Basis::Table { z_m, theta_rad, columns: vec![column] };
            vec![Term { statistic: Statistic::Variance, basis, coefficients: vec![1.0] }]
        })
    };
    (0..eigen.eigenvalues.len()).filter_map(direction).collect()
}

/// Whether the log variance changes noticeably with it.
fn tells(column: &[f64]) -> bool {
    column.iter().all(|c| c.is_finite()) && column.iter().any(|c| c.abs() > 0.05)
}

/// Derivatives of log variance with respect to the sigma model's parameters: all of them, those that a
/// frontal target determines, and each alone. Also large changes of the level parameters, and
/// [`moved_depths`].
fn recalibrations(reach: &Extent, sigma: &SigmaModel) -> Vec<Candidate> {
    let (z_m, theta_rad) = table_reach(reach);
    let table = |model: &SigmaModel| log_variances(model, z_m, theta_rad);
    let base = table(sigma);
    let columns: Vec<(usize, Vec<f64>)> = (0..sigma.parameters.len())
        .filter_map(|j| {
            let mut moved = sigma.clone();
            // One per cent of the parameter.
            let step = 0.01 * sigma.parameters[j].abs().max(1e-9);
            moved.parameters[j] += step;
            let column: Vec<f64> =
                table(&moved).iter().zip(&base).map(|(m, b)| (m - b) / 0.01).collect();
            tells(&column).then_some((j, column))
        })
        .collect();
    // Large changes are not linear: the level parameters by about a third up and down.
    let frontal: Vec<&(usize, Vec<f64>)> = columns.iter().filter(|(j, _)| *j < 3).collect();
    let bent: Vec<Vec<f64>> = frontal
        .iter()
        .flat_map(|(j, _)| [0.7, 1.4].map(|factor| (*j, factor)))
        .filter_map(|(j, factor)| {
            let mut moved = sigma.clone();
            moved.parameters[j] *= factor;
            let column: Vec<f64> = table(&moved).iter().zip(&base).map(|(m, b)| m - b).collect();
            column.iter().all(|c| c.is_finite()).then_some(column)
        })
        .collect();
    // A single wrong parameter is as simple as a formula of one.
    let moved = moved_depths(sigma, z_m, theta_rad);
    let level = (frontal.len() < columns.len())
        .then(|| frontal.iter().map(|(_, column)| column.clone()).collect());
    let columns: Vec<Vec<f64>> = columns.into_iter().map(|(_, column)| column).collect();
    let alone = columns.iter().cloned().chain(moved).map(|column| vec![column]);
    std::iter::once(bent)
        .chain(alone)
        .chain(level)
        .chain([columns.clone()])
        .filter(|columns: &Vec<Vec<f64>>| !columns.is_empty())
        .map(|columns| Basis::Table { z_m, theta_rad, columns })
        .map(|table| Candidate::named(RECALIBRATE, table))
        .collect()
}

/// Change of log variance over the model's at z', due to a depth scale, z' = (1 + s) z, and a disparity
/// offset, z' = z + c z^2, per s and per c. Planes do not show these, and noise that moves with them is
/// no new physics. To first order, with the tilts unchanged.
fn moved_depths(sigma: &SigmaModel, z_m: [f64; 2], theta_rad: [f64; 2]) -> Vec<Vec<f64>> {
    const SMALL: f64 = 0.01;
    let column = |of: &dyn Fn(f64, f64) -> f64| {
        let at = |n| {
            let (z, theta) = table_place(z_m, theta_rad, n);
            let log = |z| 2.0 * sigma.sigma(z, theta).ln();
            // Step towards the middle: beyond its ends a sigma continues as it ended.
            let share = if z * z > z_m[0] * z_m[1] { 1.0 - SMALL } else { 1.0 + SMALL };
            of(z, (log(z * share) - log(z)) / share.ln())
        };
        (0..TABLE * TABLE).map(at).collect::<Vec<f64>>()
    };
    let mut columns = vec![column(&|_, slope| 2.0 - slope), column(&|z, slope| z * (4.0 - slope))];
    // A sigma proportional to z is unaffected by a scale, one proportional to z^2 by an offset.
    columns.retain(|c| tells(c));
    columns
}

/// Nameless curves over one axis, and maps over two.
fn curves(camera: &Camera, reach: &Extent) -> Vec<Candidate> {
    let (width, height) = (camera.width as f64, camera.height as f64);
    let curve = |over, [low, high]: [f64; 2], nodes| {
        Candidate::curve(Basis::Curve { over, low, high, nodes, times: Modulation::One })
    };
    let on_target = |nodes| {
        Candidate::curve(Basis::Pair {
            over: [Coordinate::Right, Coordinate::Down],
            low: [reach.right[0], reach.down[0]],
            high: [reach.right[1], reach.down[1]],
            nodes,
        })
    };
    let mut all = vec![
        curve(Coordinate::LogZ, reach.z.map(f64::ln), 8),
        curve(Coordinate::Theta, reach.theta, 6),
        Candidate::ring(Coordinate::Azimuth, std::f64::consts::TAU, 8),
        curve(Coordinate::Radius, [0.0, 1.0], 8),
        curve(Coordinate::Column, [0.0, width], 12),
        curve(Coordinate::Row, [0.0, height], 12),
        Candidate::ring(Coordinate::Disparity, 1.0, 8),
        curve(Coordinate::Edge, [0.0, 24.0], 6),
        curve(Coordinate::Right, reach.right, 8),
        curve(Coordinate::Down, reach.down, 8),
        Candidate::curve(Basis::Map { width, height, across: 6, down: 4, times: Modulation::One }),
        on_target([6, 5]),
        // A spot on a board that is seen from near and far.
        on_target([12, 10]),
    ];
    for (over, range) in [
        (Coordinate::Session, reach.session),
        (Coordinate::Temperature, reach.temperature),
        (Coordinate::Light, reach.light),
    ] {
        if range[1] - range[0] > 0.05 * range[0].abs() {
            all.push(curve(over, range, 6));
        }
    }
    all.extend(onsets(reach.session));
    all
}

/// Steps of the noise at a time of the session; a curve with few nodes cannot follow one.
fn onsets([start, end]: [f64; 2]) -> impl Iterator<Item = Candidate> {
    const PLACES: usize = 8;
    let wide = (end - start) / PLACES as f64;
    let onset = move |k| Candidate::step(Coordinate::Session, start + wide * k as f64, 0.5 * wide);
    (1..PLACES).filter(move |_| wide > 0.0).map(onset)
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// Eq. 1 across the plane with z^3 added along the axis, which frontally is the larger from 1.4 m on: the refit follows the
    /// log variance within 2 %, up to 66 degrees.
    #[test]
    fn the_refit_follows_noise_of_both_directions() {
        let mut reach = Extent::of(std::iter::empty());
        (reach.z, reach.theta) = ([0.8, 3.8], [0.0, 66f64.to_radians()]);
        let Basis::Table { z_m, theta_rad, columns } = refit(&reach).basis else {
            panic!("a table")
        };
        let log_variance = |n| {
            let (z, theta) = table_place(z_m, theta_rad, n);
            let across = 0.00151 + 0.00215 * (z - 0.483f64).powi(2);
            let along = 0.0012 * z.powi(3);
            ((across / theta.cos()).powi(2) + along * along).ln()
        };
        let target = DVector::from_fn(TABLE * TABLE, |n, _| log_variance(n));
        let table = DMatrix::from_fn(TABLE * TABLE, columns.len(), |n, j| columns[j][n]);
        let fit = table.clone().svd(true, true).solve(&target, 1e-12).expect("both sides");
        let off = (table * fit - target).amax();
        assert!(off < 0.02, "{off}");
    }
}
