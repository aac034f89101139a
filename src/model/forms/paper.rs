//! Yamaguchi et al. 2016, Eq. 1: six parameters.

use super::tilt::{BestTilt, EXPONENTS, LOG_POLE, TiltSearch, tilt};
use super::{Card, MAX_PARAMETERS, SigmaForm, Start, Walk};
use crate::measure::SigmaRow;
use crate::model::rows::Rows;

/// a, b, c, d, e, f as printed (m and rad).
pub const PAPER_EQ1: [f64; 6] = [0.00151, 0.00215, 0.483, 1.88e-6, 2.01, 1.39];

pub(super) struct Paper;

/// Derivatives of a + b (z - c)^2 by a, b, c.
pub(super) fn vertex_gradient(p: &[f64], z: f64, out: &mut [f64; MAX_PARAMETERS]) {
    let off = z - p[2];
    out[0] = 1.0;
    out[1] = off * off;
    out[2] = -2.0 * p[1] * off;
}

/// Converts alpha + beta z + gamma z^2 to (a, b, c); `None` when it opens downwards.
pub(super) fn vertex(alpha: f64, beta: f64, gamma: f64) -> Option<[f64; 3]> {
    let c = -beta / (2.0 * gamma);
    (gamma > 0.0).then_some([alpha - gamma * c * c, gamma, c])
}

/// Largest plausible |c|, m: a vertex farther away is an extrapolation, not a measurement.
const VERTEX_REACH_M: f64 = 5.0;

/// Start of a + b (z - c)^2 + d h with h known: a linear fit. Falls back to holding c where the parabola
/// opens downwards or its vertex is too far away, and d at zero where tilt adds no noise.
pub(super) fn parabola_start(rows: &Rows, h: impl Fn(&SigmaRow) -> f64) -> Option<Start> {
    let tilted = tilts_differ(rows) && rows.iter().any(|r| h(r) > 0.0);
    let mut remarks = Vec::new();
    let columns = |tilt: bool| {
        rows.solve_linear(3 + usize::from(tilt), |r, out| {
            out[0] = 1.0;
            out[1] = r.z_m;
            out[2] = r.z_m * r.z_m;
            if tilt {
                out[3] = h(r);
            }
        })
    };
    let full = if tilted { columns(true).filter(|q| q[3] > 0.0) } else { None };
    let (with_tilt, d) = (full.is_some(), full.as_ref().map_or(0.0, |q| q[3]));
    let q = full.or_else(|| columns(false));
    let near = |c: f64| (-VERTEX_REACH_M..=VERTEX_REACH_M).contains(&c);
    let abc = q.and_then(|q| vertex(q[0], q[1], q[2])).filter(|abc| near(abc[2]));
    let held_c = abc.is_none();
    let [a, b, c] = match abc {
        Some(abc) => abc,
        None => vertex_held(rows, &mut remarks)?,
    };
    match (with_tilt, tilted) {
        (true, _) => {}
        (_, true) => {
            remarks.push("tilt adds no noise that these views show: d is held at zero".into());
        }
        _ => remarks.push("all views have the same tilt: d is held at zero".into()),
    }
    Some(Start {
        parameters: vec![a, b, c, d],
        held: vec![false, false, held_c, !with_tilt],
        remarks,
    })
}

/// Whether the views differ in tilt at all. If not, the tilt term is one more function of z alone.
fn tilts_differ(rows: &Rows) -> bool {
    let [min, max] = rows.range(|r| r.theta_rad);
    max - min > ONE_TILT_DEG.to_radians()
}

/// Views within this range have the same tilt: it is the error of a board set up by hand and eye.
const ONE_TILT_DEG: f64 = 5.0;

/// a and b with c held at the paper's value.
fn vertex_held(rows: &Rows, remarks: &mut Vec<String>) -> Option<[f64; 3]> {
    let c = PAPER_EQ1[2];
    let q = rows.solve_linear(2, |r, out| {
        out[0] = 1.0;
        out[1] = (r.z_m - c).powi(2);
    })?;
    remarks.push(format!(
        "b and c cannot be told apart from these distances: c is held at the paper's {c} m"
    ));
    (q[1] > 0.0).then_some([q[0], q[1], c])
}

/// Drop of chi-square that three more parameters gain by chance in 1 % of cases (3 degrees of freedom).
const TILT_WORTH: f64 = 11.3;

impl SigmaForm for Paper {
    fn card(&self) -> &'static Card {
        &Card {
            id: "paper",
            formula: "sigma = a + b (z - c)^2 + d z^e theta^2 / (f - theta)^2 (m; z in m, theta in rad)",
            reference: "Yamaguchi, Emaru, Kobayashi and Ravankar, SII 2016, Eq. 1",
            parameters: &[
                ("a", Walk::Linear),
                ("b", Walk::Log),
                ("c", Walk::Linear),
                ("d", Walk::Log),
                ("e", Walk::Linear),
                ("f", Walk::LogAboveTheta),
            ],
            distances_needed: 3,
        }
    }

    fn sigma(&self, p: &[f64], z: f64, theta: f64) -> f64 {
        let axial = p[0] + p[1] * (z - p[2]).powi(2);
        if theta == 0.0 { axial } else { axial + p[3] * z.powf(p[4]) * tilt(theta, p[5]) }
    }

    fn gradient(&self, p: &[f64], z: f64, theta: f64, out: &mut [f64; MAX_PARAMETERS]) {
        vertex_gradient(p, z, out);
        let unit = z.powf(p[4]) * tilt(theta, p[5]);
        out[3] = unit;
        out[4] = p[3] * unit * z.ln();
        out[5] = -2.0 * p[3] * unit / (p[5] - theta);
    }

    fn vertex(&self, p: &[f64]) -> Option<f64> {
        Some(p[2])
    }

    fn pole(&self, p: &[f64]) -> Option<f64> {
        Some(p[5])
    }

    /// By variable projection: for given (e, f) the rest is linear, so only these two are searched.
    fn start(&self, rows: &Rows) -> Option<Start> {
        let steep = rows.steepest() >= TILT_MAY_SHOW_DEG.to_radians();
        let best = if steep { TiltSearch::new(rows).map(|s| s.best()) } else { None };
        match best.filter(|b| b.gain > TILT_WORTH * rows.noise_scale(b.chi2)) {
            Some(best) => with_tilt(rows, &best),
            None => without_tilt(rows),
        }
    }

    fn limits(&self, i: usize, rows: &Rows) -> Option<[f64; 2]> {
        match i {
            4 => Some(EXPONENTS),
            5 => Some(LOG_POLE.map(|g| rows.steepest() + g.exp())),
            _ => None,
        }
    }

    fn why_weak(&self, i: usize, rows: &Rows) -> Option<String> {
        match i {
            0..=2 => Some(format!(
                "a, b and c cannot be told apart well: the nearest view is at {:.2} m, c needs views on both sides of it",
                rows.range(|r| r.z_m)[0]
            )),
            _ => Some(why_no_tilt(rows)),
        }
    }
}

fn with_tilt(rows: &Rows, best: &BestTilt) -> Option<Start> {
    let mut start = parabola_start(rows, |r| r.z_m.powf(best.e) * tilt(r.theta_rad, best.f))?;
    let held = start.held[3];
    start.parameters.extend([best.e, best.f]);
    start.held.extend([held || best.at_edge[0], held || best.at_edge[1]]);
    if best.at_edge.contains(&true) {
        start.remarks.push(format!(
            "the tilt term runs to the edge of what is believed: {}",
            why_no_tilt(rows)
        ));
    }
    Some(start)
}

/// e and f as printed in the paper, and d where the data determine it.
fn without_tilt(rows: &Rows) -> Option<Start> {
    let (e, f) = (PAPER_EQ1[4], PAPER_EQ1[5].max(rows.steepest() + 0.02));
    let mut start = parabola_start(rows, |r| r.z_m.powf(e) * tilt(r.theta_rad, f))?;
    start.parameters.extend([e, f]);
    start.held.extend([true, true]);
    start.remarks.push(format!("e and f are held at {e} and {f:.3} rad: {}", why_no_tilt(rows)));
    Some(start)
}

/// Without a view this steep, anything else that grows with tilt would be fitted as a pole.
const TILT_MAY_SHOW_DEG: f64 = 70.0;

/// Below this tilt the tilt term of Eq. 1 is under a tenth of the axial one (the exact tilt is 71.9 to 73.5
/// degrees, between 0.5 and 4 m).
const TILT_SHOWS_DEG: f64 = 74.0;

fn why_no_tilt(rows: &Rows) -> String {
    let steepest = rows.steepest().to_degrees();
    if steepest < TILT_SHOWS_DEG {
        format!(
            "d, e and f cannot be told apart: no view is tilted past {TILT_SHOWS_DEG} degrees (steepest {steepest:.1})"
        )
    } else {
        format!(
            "d, e and f cannot be told apart: too few or too noisy views between {TILT_SHOWS_DEG} and {steepest:.1} degrees"
        )
    }
}
