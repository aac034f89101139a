//! The board is not flat.

use super::{
    Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Flat, Parameter, Settings, Smallest, Stage,
};
use crate::stats::{even, range};
use crate::terms::{Basis, PixelContext};

pub struct TargetBow;

pub(super) static CARD: Card = Card {
    id: "target-bow",
    title: "a bent target",
    stage: Stage::Surface,
    summary: "the board is bent: its middle stands out towards the sensor, a parabola along its right, fixed on the board and not in the picture",
    parameters: &[
        Parameter {
            name: "sagitta_m",
            range: [-0.1, 0.1],
            typical: 0.004,
            summary: "rise of the middle over the ends, towards the sensor",
        },
        Parameter {
            name: "span_m",
            range: [0.05, 20.0],
            typical: 1.0,
            summary: "width of the board over which it is counted",
        },
    ],
    statistic: "bias",
    axis: "target-position",
    confused_with: "radial-disparity-bias and lens-distortion, which stay in the picture when the board moves; turn the board by 180 degrees, or move it aside",
    reference: "geometry of a bent plate: millimetres, whatever the distance",
    formula_error: 0.3,
    ..Card::BASE
};

impl Effect for TargetBow {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let Some(target) = exposure.seen.target else { return };
        let (sagitta, half_span) = (settings.at(0), 0.5 * settings.at(1));
        for i in 0..exposure.pixels() {
            if exposure.seen.is_target(i) {
                let (right, _) = target.place(&exposure.point(i));
                let lift = -sagitta * (right / half_span).powi(2);
                // The ends stay where the flat board had them.
                exposure.depth[i] = exposure.meet(i, exposure.rays.at(i), sagitta + lift) as f32;
            }
        }
    }

    /// Bent along its sides; dented or bulging in its middle, as a clamped plate's r^4 and a bump's r^6
    /// describe (Timoshenko and Woinowsky-Krieger 1959, chapter 3); or otherwise.
    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        vec![Basis::relief(2), Basis::dome(3), Basis::relief(4)]
    }

    /// A board bends by about 1 mm at 1 m, a poor one by 1.5 mm half a metre from its middle. One of stated
    /// flatness bends by anything up to that, either way, over the part seen: a rectangular distribution.
    fn usual(&self, shape: &Basis, k: usize, flat: Option<&Flat>) -> f64 {
        let degree = match (shape, k) {
            (Basis::Powers { .. }, k) => 2 * (k as i32 + 1),
            (_, 0..3) => 2,
            (_, 3..7) => 3,
            _ => 4,
        };
        let (bow_m, half_m) = flat.map_or((BOW_M, 0.5), |f| {
            let half = |[low, high]: [f64; 2]| 0.5 * (high - low);
            (f.flatness_m / 3f64.sqrt(), half(f.right).max(half(f.down)))
        });
        bow_m / half_m.powi(degree)
    }

    fn agrees_with(&self, flat: Option<&Flat>, shape: &Basis, coefficients: &[f64]) -> bool {
        flat.is_none_or(|flat| {
            relief_m(flat, shape, coefficients) <= BEYOND_STATED * flat.flatness_m
        })
    }

    /// Sagitta over the part of the board that was seen, along the side that is bent more; of a dome, along
    /// the longer.
    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let (right, down) = (half_square(fit.reach.right), half_square(fit.reach.down));
        let is_dome = matches!(fit.shape, Basis::Powers { .. });
        let along_right =
            |b: &[f64]| if is_dome { right > down } else { (b[0] * right).abs() > (b[1] * down).abs() };
        let span = if along_right(fit.coefficients) { fit.reach.right } else { fit.reach.down };
        let sagitta = |b: &[f64]| {
            let half_square = if along_right(b) { right } else { down };
            match is_dome {
                true => -(0..b.len()).map(|k| b[k] * half_square.powi(k as i32 + 1)).sum::<f64>(),
                false => -half_square * if along_right(b) { b[0] } else { b[1] },
            }
        };
        vec![
            fit.estimate("sagitta_m", &sagitta),
            // The board's pixels end within a few pixels of its edge.
            Estimate::given("span_m", span[1] - span[0], f64::NAN),
        ]
    }

    fn smallest(&self, bounds: &Bounds) -> Option<Smallest> {
        let unit = vec![1.0 / half_square(bounds.reach.right), 0.0, 0.0];
        let (parameter, shape) = ("sagitta_m", Basis::relief(2));
        Some(Smallest { parameter, shape, unit, of: |a| a })
    }
}

/// Bow of a board, half a metre from its middle, m.
const BOW_M: f64 = 0.0015;

/// A bend is fitted together with all else that bends a picture, and up to the corners of what was seen: up
/// to this multiple of the stated flatness it is compatible with a flat board.
const BEYOND_STATED: f64 = 2.0;

/// Height range of a surface over the part of it seen, with its slope removed, m.
fn relief_m(flat: &Flat, shape: &Basis, coefficients: &[f64]) -> f64 {
    const NODES: usize = 9;
    let middle = |[low, high]: [f64; 2]| 0.5 * (low + high);
    let (at_right, at_down) = (middle(flat.right), middle(flat.down));
    let mut places: Vec<[f64; 3]> = Vec::new();
    for right in even(flat.right, NODES) {
        for down in even(flat.down, NODES) {
            // Unit disparity and distance, so that a lift is in metres.
            let place = PixelContext { right, down, disparity: 1.0, rho: 1.0, ..Default::default() };
            let height = shape.value(coefficients, &place);
            places.push([right - at_right, down - at_down, height]);
        }
    }
    // The grid is symmetric about its middle, so the two slopes are independent.
    let slope = |k: usize| {
        let square: f64 = places.iter().map(|p| p[k] * p[k]).sum();
        places.iter().map(|p| p[k] * p[2]).sum::<f64>() / square.max(f64::MIN_POSITIVE)
    };
    let (across, along) = (slope(0), slope(1));
    let [low, high] = range(places.iter().map(|p| p[2] - across * p[0] - along * p[1]));
    high - low
}

fn half_square([low, high]: [f64; 2]) -> f64 {
    (0.5 * (high - low)).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT: Flat = Flat { flatness_m: 2e-4, right: [-0.5, 0.5], down: [-0.4, 0.4] };

    /// A sagitta of s over a half width of 0.5 m is s/0.25 right^2; tilts and offsets are no bend.
    #[test]
    fn a_board_is_no_more_bent_than_it_is_stated_to_be() {
        let bent = |sagitta: f64| [-sagitta / 0.25, 0.0, 0.0];
        let relief = relief_m(&FLAT, &Basis::relief(2), &bent(0.005));
        assert!((relief - 0.005).abs() < 1e-12, "{relief}");
        let twist = relief_m(&FLAT, &Basis::relief(2), &[0.0, 0.0, 0.01]);
        assert!((twist - 2.0 * 0.01 * 0.5 * 0.4).abs() < 1e-12, "{twist}");
        let agrees = |sagitta| TargetBow.agrees_with(Some(&FLAT), &Basis::relief(2), &bent(sagitta));
        assert!(agrees(0.0002) && agrees(-0.0003));
        assert!(!agrees(0.005) && !agrees(-0.005));
    }

    #[test]
    fn what_is_stated_takes_the_place_of_what_is_usual() {
        let bend = Basis::relief(2);
        assert_eq!(TargetBow.usual(&bend, 0, None), BOW_M / 0.25);
        let stated = TargetBow.usual(&bend, 0, Some(&FLAT));
        assert!((stated - 2e-4 / 3f64.sqrt() / 0.25).abs() < 1e-15, "{stated}");
    }
}
