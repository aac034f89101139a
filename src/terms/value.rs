//! A term's value without its whole row: curves and maps have a few columns that are not zero.

use super::Term;
use super::basis::Basis;
use super::place::PixelContext;
use super::series::{cubic, interpolated, node, on_ring};

impl Term {
    /// At a place, px or nepers of variance. `row` is scratch.
    pub fn value(&self, p: &PixelContext, row: &mut Vec<f64>) -> f64 {
        let b = &self.coefficients[..];
        match self.basis {
            // Of a lift's columns none is nothing: its straight part is taken out.
            Basis::Curve { over, low, high, nodes, times } if !self.basis.is_lift_of_target() => {
                let (k, t) = node(over.value(p), low, high, nodes);
                times.value(p) * (b[k] * (1.0 - t) + b[k + 1] * t)
            }
            Basis::Ring { over, period, nodes, times } => {
                let ([k, next], t) = on_ring(over.value(p), period, nodes);
                times.value(p) * (b[k] * (1.0 - t) + b[next] * t)
            }
            Basis::Map { width, height, across, down, times } => {
                let column = node(p.u, 0.0, width - 1.0, across);
                let row = node(p.v, 0.0, height - 1.0, down);
                times.value(p) * interpolated(b, across, column, row)
            }
            Basis::Spline { width, height, across, down, times } => {
                let (i, of_columns) = cubic(p.u, width - 1.0, across);
                let (j, of_rows) = cubic(p.v, height - 1.0, down);
                let along = |j: usize| -> f64 {
                    b[j * across + i..].iter().zip(of_columns).map(|(b, w)| b * w).sum()
                };
                let over = of_rows.iter().enumerate().map(|(row, w)| w * along(j + row));
                times.value(p) * over.sum::<f64>()
            }
            Basis::Pair { over, low, high, nodes } => {
                let first = node(over[0].value(p), low[0], high[0], nodes[0]);
                let second = node(over[1].value(p), low[1], high[1], nodes[1]);
                interpolated(b, nodes[0], first, second)
            }
            _ => self.basis.value(b, p, row),
        }
    }

    /// Of all these terms together.
    pub fn sum(terms: &[Term], p: &PixelContext, row: &mut Vec<f64>) -> f64 {
        terms.iter().map(|t| t.value(p, row)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terms::{Coordinate, Modulation, Statistic};

    /// The short way against the whole row.
    #[test]
    fn the_value_is_the_row_times_the_coefficients() {
        let (over, times) = (Coordinate::Disparity, Modulation::DisparitySquared);
        let bases = [
            Basis::Curve { over, low: 5.0, high: 60.0, nodes: 7, times },
            Basis::Curve {
                over: Coordinate::Right,
                low: -1.0,
                high: 1.0,
                nodes: 7,
                times: Modulation::Lift,
            },
            Basis::Curve { over, low: 5.0, high: 60.0, nodes: 7, times: Modulation::Lift },
            Basis::Ring { over, period: 3.0, nodes: 5, times: Modulation::Lift },
            Basis::Map { width: 640.0, height: 480.0, across: 5, down: 4, times: Modulation::Tilt },
            Basis::Spline { width: 640.0, height: 480.0, across: 5, down: 4, times },
            Basis::Pair {
                over: [over, Coordinate::Row],
                low: [5.0, 0.0],
                high: [60.0, 479.0],
                nodes: [3, 6],
            },
            Basis::waves(Coordinate::Column, 30.0, 2),
        ];
        for basis in bases {
            let coefficients: Vec<f64> =
                (0..basis.count()).map(|k| (1.7 * k as f64).sin()).collect();
            let term = Term { statistic: Statistic::Bias, basis, coefficients };
            for k in 0..200 {
                let (u, v) = (f64::from(k * 3), f64::from(k * 37 % 480));
                let disparity = 0.4 * f64::from(k);
                let place = PixelContext {
                    u,
                    v,
                    disparity,
                    rho: 1.3,
                    theta: 0.4,
                    ..PixelContext::default()
                };
                let whole = term.basis.value(&term.coefficients, &place, &mut Vec::new());
                let short = term.value(&place, &mut Vec::new());
                assert!((short - whole).abs() < 1e-12, "{:?} {k}: {short} {whole}", term.basis);
            }
        }
    }

    /// A board that is moved and tilted as a whole is where it was.
    #[test]
    fn a_lift_has_no_straight_part() {
        let basis = Basis::Curve {
            over: Coordinate::Right,
            low: -0.5,
            high: 0.7,
            nodes: 6,
            times: Modulation::Lift,
        };
        let bent: Vec<f64> = (0..6).map(|k| (2.1 * f64::from(k)).sin()).collect();
        let moved: Vec<f64> = (0..6).map(|k| bent[k] + 4.0 - 1.5 * k as f64).collect();
        for k in 0..50 {
            let right = f64::from(k) * 0.03 - 0.6;
            let place =
                PixelContext { right, disparity: 40.0, rho: 2.0, ..PixelContext::default() };
            let [a, b] = [&bent, &moved].map(|c| basis.value(c, &place, &mut Vec::new()));
            assert!((a - b).abs() < 1e-10, "{right}: {a} {b}");
        }
        let line: Vec<f64> = (0..6).map(|k| 1.0 + f64::from(k)).collect();
        let place =
            PixelContext { right: 0.3, disparity: 40.0, rho: 2.0, ..PixelContext::default() };
        assert!(basis.value(&line, &place, &mut Vec::new()).abs() < 1e-10);
    }
}
