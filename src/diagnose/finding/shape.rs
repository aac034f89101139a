//! Describes curves in words.

use crate::terms::{Axis, Basis, Coordinate};

/// Description of a nameless curve.
pub fn words(basis: &Basis, beta: &[f64]) -> String {
    match basis {
        Basis::Ring { period, over, .. } | Basis::Waves { period, over, .. } => {
            let of = match basis.axis() {
                Axis::DisparityPhase => "disparity",
                _ => over.axis().in_words(),
            };
            format!("periodic in the {of}, period {}", place(*period, *over))
        }
        Basis::Map { .. } | Basis::Spline { .. } => {
            "a smooth pattern that stands still in the picture".into()
        }
        Basis::Pair { over, .. } => match over.map(|o| o.axis().in_words()) {
            [a, b] if a == b => format!("depends on the {a}"),
            [a, b] => format!("depends on the {a} and the {b} together"),
        },
        Basis::Curve { over, low, high, nodes, .. } => {
            if *nodes == 2 {
                return format!("a step at {}", place(0.5 * (low + high), *over));
            }
            let at = |k: f64| place(low + (high - low) * k / (nodes - 1) as f64, *over);
            curve(beta, &at)
        }
        Basis::Table { .. } => "as other parameters of sigma have it".into(),
        // A named cause's formula that lost its name.
        _ => "of a shape that the catalogue has, on which the views do not agree".into(),
    }
}

/// A value of the coordinate to three digits, with its unit.
fn place(value: f64, over: Coordinate) -> String {
    let unit = match over {
        Coordinate::Column | Coordinate::Row | Coordinate::Edge | Coordinate::Disparity => " px",
        Coordinate::Z | Coordinate::Right | Coordinate::Down => " m",
        Coordinate::LogZ => return digits(value.exp()) + " m",
        Coordinate::Theta | Coordinate::Azimuth => " rad",
        Coordinate::Session => " s",
        Coordinate::Radius => " of the corner's",
        _ => "",
    };
    digits(value) + unit
}

/// Formats a value to three digits, with at most four decimals.
pub fn digits(value: f64) -> String {
    let decimals = (2.0 - value.abs().max(1e-2).log10().floor()).clamp(0.0, 4.0) as usize;
    crate::units::decimals(value, decimals)
}

/// Description of a curve with the node values `beta`; `at` formats the position of the k-th node.
fn curve(beta: &[f64], at: &dyn Fn(f64) -> String) -> String {
    let n = beta.len();
    let [low, high] = crate::stats::range(beta.iter().copied());
    let height = high - low;
    if n < 4 || height <= 0.0 {
        return "flat".into();
    }
    let steps: Vec<f64> = beta.windows(2).map(|w| w[1] - w[0]).collect();
    let walked: f64 = steps.iter().map(|s| s.abs()).sum();
    let (jump, size) = steps
        .iter()
        .enumerate()
        .map(|(k, s)| (k, s.abs()))
        .fold((0, 0.0), |best, s| if s.1 > best.1 { s } else { best });
    let net = (beta[n - 1] - beta[0]).abs();
    let turns = {
        // Only turns by more than a quarter of the height count.
        let (mut turns, mut extreme, mut direction) = (0, beta[0], 0.0f64);
        for &b in beta {
            let moved = b - extreme;
            if direction == 0.0 && moved.abs() > 0.25 * height {
                (direction, extreme) = (moved.signum(), b);
            } else if direction != 0.0 && moved * direction > 0.0 {
                extreme = b;
            } else if direction != 0.0 && moved.abs() > 0.25 * height {
                (turns, direction, extreme) = (turns + 1, -direction, b);
            }
        }
        turns
    };
    if net > 0.7 * height && walked < 1.6 * height {
        if size > 0.6 * height {
            return format!("a step at {}", at(jump as f64 + 0.5));
        }
        let rising = beta[n - 1] > beta[0];
        return format!("monotone, {}", if rising { "rising" } else { "falling" });
    }
    if turns >= 4 {
        return format!("wavy, {} turns", turns);
    }
    let top = (0..n).fold(0, |best, k| {
        let far = |k: usize| (beta[k] - 0.5 * (beta[0] + beta[n - 1])).abs();
        if far(k) > far(best) { k } else { best }
    });
    let kind = if beta[top] > 0.5 * (beta[0] + beta[n - 1]) { "bump" } else { "dip" };
    format!("a {kind} at {}", at(top as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terms::Modulation;

    fn of(values: impl Fn(f64) -> f64) -> String {
        let nodes = 16;
        let beta: Vec<f64> = (0..nodes).map(|k| values(k as f64 / 15.0)).collect();
        let over = Coordinate::Row;
        words(&Basis::Curve { over, low: 0.0, high: 1.0, nodes, times: Modulation::One }, &beta)
    }

    #[test]
    fn curves_are_told_by_their_shape() {
        assert_eq!(of(|x| f64::from(x > 0.5)), "a step at 0.500 px");
        assert_eq!(of(|x| x * x), "monotone, rising");
        assert_eq!(of(|x| -x), "monotone, falling");
        assert!(of(|x| (-(x - 0.4f64).powi(2) / 0.01).exp()).starts_with("a bump at 0.400 px"));
        assert!(of(|x| (20.0 * x).sin()).starts_with("wavy"));
    }
}
