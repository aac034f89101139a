//! Vertical stripes.

use std::f64::consts::{FRAC_2_PI, TAU};

use rand::Rng;

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Inverse, Parameter, Scope, Settings, Smallest, Stage, greatest};
use crate::camera::Camera;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Coordinate, Modulation, PixelContext, Term};

pub struct ColumnBanding;

pub(super) static CARD: Card = Card {
    id: "column-banding",
    title: "column banding",
    stage: Stage::Disparity,
    summary: "the firmware applies a correction that is linear in the column in whole steps: what is left is a saw-tooth over the columns, the same in every row; a Kinect begins anew with every view",
    parameters: &[
        Parameter {
            name: "amplitude_px",
            range: [0.0, 1.0],
            typical: 0.0625,
            summary: "half the height of a tooth: half a step of the read-out",
        },
        Parameter {
            name: "period_px",
            range: [2.0, 640.0],
            typical: 80.0,
            summary: "columns from one step to the next",
        },
        Parameter {
            name: "spread",
            range: [1.0, 20.0],
            typical: 1.0,
            summary: "the largest period of a view over the smallest; above 1 every view has its own, with a step in the middle",
        },
    ],
    kinds: SensorKind::MATCHING,
    statistic: "bias",
    axis: "column",
    confused_with: "target-bow, which moves and turns with the board; disparity-quantisation on a tilted plane, whose contours move with the distance",
    reference: "OpenNI property GmcMode: a correction in the read-out's steps of 1/8 px; 2 to 8 bands",
    is_symptom: true,
    formula_error: 0.3,
    // On a real sensor the bands are superimposed on a smooth error of the column that is not part of them.
    must_explain: Some(0.45),
    ..Card::BASE
};

impl Effect for ColumnBanding {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw) {
        let (amplitude, period) = (settings.at(0), settings.at(1));
        let (width, centre) = (exposure.seen.width, exposure.sensor.camera.cx);
        if settings.at(2) > 1.0 {
            let share: f64 = draw.stream(Scope::View, "period").random();
            let period = period * settings.at(2).powf(share - 0.5);
            // With a step in the middle the bands begin half a period later. The disparity falls at a step,
            // as observed.
            let middle = 0.5 * (width as f64 + period);
            exposure.shift_disparity(|i| tooth(i % width, middle, -amplitude, period));
            return;
        }
        exposure.shift_disparity(|i| tooth(i % width, centre, amplitude, period));
    }

    fn shapes(&self, bounds: &Bounds) -> Vec<Basis> {
        let mut all = Vec::new();
        // Bands repeat: at least three periods.
        for half_cycles in 6..=64 {
            let period_px = 2.0 * bounds.camera.width as f64 / f64::from(half_cycles);
            // Waves shorter than two patches alias to long ones.
            let resolved = (period_px / (2.0 * bounds.patch_px)) as usize;
            if resolved > 0 {
                all.push(stripes(period_px, resolved.min(4)));
            }
            if half_cycles <= 16 && resolved > 4 {
                all.push(stripes(period_px, resolved.min(8)));
            }
        }
        all
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let Basis::Waves { period: period_px, harmonics, .. } = *fit.shape else {
            return Vec::new();
        };
        let at = |t: f64| PixelContext { u: t * period_px, ..PixelContext::default() };
        let height = |b: &[f64]| greatest(|t| fit.value(b, at(t)));
        let amplitude =
            fit.estimate("amplitude_px", &|b| height(b) / greatest(|t| blunt_tooth(t, harmonics)));
        // A shift that turns the phase of the first harmonic by an angle turns the k-th by k times that.
        let sure = |k: usize| {
            let size = fit.estimate("", &|b| b[2 * k].hypot(b[2 * k + 1]));
            ((k + 1) as f64 * size.value / size.std_error).powi(2)
        };
        let share = (0..harmonics).map(sure).sum::<f64>().sqrt().recip();
        let std_error = error_of_period(period_px, share, fit.reach.column);
        vec![amplitude, Estimate::given("period_px", period_px, std_error)]
    }

    fn term(&self, settings: &Settings, camera: &Camera) -> Option<Term> {
        let [amplitude, period, spread] = [0, 1, 2].map(|k| settings.at(k));
        if spread > 1.0 {
            return None;
        }
        let nodes = camera.width.max(2);
        let columns = Basis::Curve {
            over: Coordinate::Column,
            low: 0.0,
            high: (nodes - 1) as f64,
            nodes,
            times: Modulation::One,
        };
        let teeth = (0..nodes).map(|u| tooth(u, camera.cx, amplitude, period)).collect();
        Some(Term::bias(columns, teeth))
    }

    fn inverse(&self, settings: &Settings, camera: &Camera) -> Option<Inverse> {
        Some(self.term(settings, camera).map_or(Inverse::ColumnSteps, Inverse::Term))
    }

    fn smallest(&self, bounds: &Bounds) -> Option<Smallest> {
        let shape = stripes(bounds.camera.width as f64 / 8.0, 1);
        Some(Smallest { parameter: "amplitude_px", shape, unit: vec![1.0, 0.0], of: |a| a })
    }
}

/// Remainder of rounding to the nearest whole step in a column, from -1 to 1 times the amplitude.
fn tooth(column: usize, centre: f64, amplitude: f64, period: f64) -> f64 {
    let bands = (column as f64 - centre) / period;
    2.0 * amplitude * (bands.round() - bands)
}

/// The first harmonics of a tooth of amplitude 1, at a phase in periods.
fn blunt_tooth(periods: f64, orders: usize) -> f64 {
    let order = |k: f64| (TAU * k * periods).sin() / k;
    FRAC_2_PI * (1..=orders).map(|k| order(k as f64)).sum::<f64>()
}

/// Relative error of the amplitude that unresolved harmonics are equivalent to: those finer than a patch
/// turn the phase of the first by 0.02 to 0.03 cycles over the picture (five ray-traced sensors).
const UNRESOLVED: f64 = 0.05;

/// Cramer-Rao bound on the period, px, of a sine whose amplitude is known to this share, sampled evenly
/// over the `columns`, px: a change of the period is known as well as the phase shift it causes (Rife and
/// Boorstyn, 1974).
fn error_of_period(period_px: f64, share: f64, columns: [f64; 2]) -> f64 {
    let length = (columns[1] - columns[0]).max(period_px);
    period_px.powi(2) * share.hypot(UNRESOLVED) / TAU * 12f64.sqrt() / length
}

fn stripes(period_px: f64, harmonics: usize) -> Basis {
    Basis::waves(Coordinate::Column, period_px, harmonics)
}
