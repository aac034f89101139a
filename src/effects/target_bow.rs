//! The board is not flat.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Parameter, Settings, Smallest, Stage};
use crate::terms::Basis;

pub struct TargetBow;

static CARD: Card = Card {
    id: "target-bow",
    title: "a bent target",
    stage: Stage::Surface,
    summary: "the board is bent: its middle stands out towards the sensor, a parabola along its right, fixed on the board and not in the picture",
    parameters: &[
        Parameter {
            name: "sagitta_m",
            unit: "m",
            range: [-0.1, 0.1],
            typical: 0.004,
            summary: "rise of the middle over the ends, towards the sensor",
        },
        Parameter {
            name: "span_m",
            unit: "m",
            range: [0.05, 20.0],
            typical: 1.0,
            summary: "width of the board over which it is counted",
        },
    ],
    identity: 0.0,
    statistic: "bias",
    axis: "target-position",
    confused_with: "radial-disparity-bias and lens-distortion, which stay in the picture when the board moves; turn the board by 180 degrees, or move it aside",
    reference: "geometry of a bent plate: millimetres, whatever the distance",
};

impl Effect for TargetBow {
    fn card(&self) -> &'static Card {
        &CARD
    }

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

    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        [2, 4].map(Basis::relief).into()
    }

    fn plain(&self, _: Basis) -> Basis {
        Basis::relief(2)
    }

    /// A board bends by about 1 mm at 1 m, and by 1.5 mm half a metre from its middle where it is a
    /// bad one.
    fn usual(&self, k: usize) -> f64 {
        let degree = if k < 3 {
            2
        } else if k < 7 {
            3
        } else {
            4
        };
        BOW_M / 0.5f64.powi(degree)
    }

    /// Over the reach of the board that was seen, along the side that is bent more.
    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let (right, down) = (half_square(fit.reach.right), half_square(fit.reach.down));
        let along_right = |b: &[f64]| (b[0] * right).abs() > (b[1] * down).abs();
        let span = if along_right(fit.coefficients) { fit.reach.right } else { fit.reach.down };
        vec![
            fit.estimate("sagitta_m", &|b| if along_right(b) { -b[0] * right } else { -b[1] * down }),
            // The board's pixels end within a few of its edge.
            Estimate::given("span_m", span[1] - span[0], f64::NAN),
        ]
    }

    fn formula_error(&self) -> f64 {
        0.3
    }

    fn smallest(&self, bounds: &Bounds) -> Option<Smallest> {
        let unit = vec![1.0 / half_square(bounds.reach.right), 0.0, 0.0];
        let (parameter, shape) = ("sagitta_m", Basis::relief(2));
        Some(Smallest { parameter, shape, unit, of: |a| a })
    }
}

/// Of a board, half a metre from its middle, m.
const BOW_M: f64 = 0.0015;

fn half_square([low, high]: [f64; 2]) -> f64 {
    (0.5 * (high - low)).powi(2)
}
