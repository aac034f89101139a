//! The tilt term of the paper's form, and the start of its fit: (e, f) by variable projection.

use nalgebra::{DMatrix, DVector};

use crate::model::rows::Rows;
use crate::solve::nelder_mead;
use crate::stats::even;

/// theta^2 / (f - theta)^2.
#[inline]
pub fn tilt(theta: f64, f: f64) -> f64 {
    let ratio = theta / (f - theta);
    ratio * ratio
}

/// Variable projection for the paper's tilt term: the improvement of a column z^e theta^2/(f - theta)^2 over
/// a parabola in z, as a function of (e, f) alone.
pub struct TiltSearch<'a> {
    rows: &'a Rows,
    log_z: Vec<f64>,
    /// Orthonormal basis of the whitened 1, z, z^2.
    basis: DMatrix<f64>,
    /// Residual of the whitened sigmas after the parabola.
    left: DVector<f64>,
}

/// Result of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BestTilt {
    pub e: f64,
    pub f: f64,
    /// Drop of the weighted chi-square against no tilt term.
    pub gain: f64,
    pub chi2: f64,
    /// Whether e and f are at the edge of the search, so that the data do not bound them.
    pub at_edge: [bool; 2],
}

/// The searched box: exponents well beyond Nguyen's -0.5 and Eq. 1's 2.01, and the pole from 0.3 degrees to
/// 3 rad past the steepest view.
pub const EXPONENTS: [f64; 2] = [-4.0, 6.0];
pub const LOG_POLE: [f64; 2] = [-5.3, 1.1];
const GRID: [usize; 2] = [9, 11];

impl<'a> TiltSearch<'a> {
    pub fn new(rows: &'a Rows) -> Option<Self> {
        let n = rows.len();
        let mut a = DMatrix::zeros(n, 3);
        for (i, row) in rows.iter().enumerate() {
            a[(i, 0)] = 1.0;
            a[(i, 1)] = row.z_m;
            a[(i, 2)] = row.z_m * row.z_m;
        }
        for j in 0..3 {
            rows.whiten(&mut a.as_mut_slice()[j * n..(j + 1) * n]);
        }
        let basis = a.qr().q();
        let y = rows.whitened_sigmas();
        let left = &y - &basis * basis.tr_mul(&y);
        let log_z = rows.iter().map(|r| r.z_m.ln()).collect();
        left.iter().all(|v| v.is_finite()).then_some(TiltSearch { rows, log_z, basis, left })
    }

    /// z^e of every row.
    fn powers(&self, e: f64) -> Vec<f64> {
        self.log_z.iter().map(|lz| (e * lz).exp()).collect()
    }

    /// theta^2 / (f - theta)^2 of every row, f given as ln(f - steepest).
    fn tilts(&self, log_pole: f64) -> Vec<f64> {
        let f = self.rows.steepest() + log_pole.exp();
        self.rows.iter().map(|r| tilt(r.theta_rad, f)).collect()
    }

    /// Drop of chi-square when the product of the two columns is added to the parabola; zero where its
    /// coefficient would be negative.
    fn gain(&self, powers: &[f64], tilts: &[f64]) -> f64 {
        let mut h: Vec<f64> = powers.iter().zip(tilts).map(|(p, t)| p * t).collect();
        self.rows.whiten(&mut h);
        let h = DVector::from_vec(h);
        let projected = self.basis.tr_mul(&h);
        let norm = h.norm_squared();
        let square = norm - projected.norm_squared();
        // `left` is orthogonal to the basis already.
        let dot = h.dot(&self.left);
        if dot > 0.0 && square > 1e-12 * norm { dot * dot / square } else { 0.0 }
    }

    fn gain_at(&self, e: f64, log_pole: f64) -> f64 {
        let inside = |v: f64, [low, high]: [f64; 2]| (low..=high).contains(&v);
        if !inside(e, EXPONENTS) || !inside(log_pole, LOG_POLE) {
            return 0.0;
        }
        self.gain(&self.powers(e), &self.tilts(log_pole))
    }

    /// The best (e, f): a grid over the box, then Nelder-Mead.
    pub fn best(&self) -> BestTilt {
        let tilts: Vec<(f64, Vec<f64>)> =
            even(LOG_POLE, GRID[1]).map(|g| (g, self.tilts(g))).collect();
        let (mut e, mut g, mut gain) = (EXPONENTS[0], LOG_POLE[1], -1.0);
        for exponent in even(EXPONENTS, GRID[0]) {
            let powers = self.powers(exponent);
            for (log_pole, tilts) in &tilts {
                let value = self.gain(&powers, tilts);
                if value > gain {
                    (e, g, gain) = (exponent, *log_pole, value);
                }
            }
        }
        let refined =
            nelder_mead(|x| -self.gain_at(x[0], x[1]), &[e, g], &[0.4, -0.2], NELDER_MEAD_STEPS);
        let value = self.gain_at(refined[0], refined[1]);
        if value > gain {
            (e, g, gain) = (refined[0], refined[1], value);
        }
        let near = |v: f64, [low, high]: [f64; 2]| (v - low).min(high - v) < 0.02 * (high - low);
        BestTilt {
            e,
            f: self.rows.steepest() + g.exp(),
            gain,
            chi2: self.left.norm_squared() - gain,
            at_edge: [near(e, EXPONENTS), near(g, LOG_POLE)],
        }
    }
}

/// The local solver refines the result, so a few digits are enough.
const NELDER_MEAD_STEPS: u64 = 40;
