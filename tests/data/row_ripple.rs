//! A ripple over the rows. Not part of the product: `tests/slow/new_effect.rs` adds it.

use std::f64::consts::TAU;

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Known, Parameter};
use super::{Settings, Smallest, Stage, greatest};
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, PixelContext, Term};

pub struct RowRipple;

pub(super) static CARD: Card = Card {
    id: "row-ripple",
    title: "a ripple over the rows",
    stage: Stage::Disparity,
    summary: "the read-out hums: the disparity rises and falls from row to row, the same in every column",
    parameters: &[
        Parameter {
            name: "amplitude_px",
            range: [0.0, 1.0],
            typical: 0.1,
            summary: "height of the hum above its mean",
        },
        Parameter {
            name: "period_px",
            range: [2.0, 480.0],
            typical: 30.0,
            summary: "rows from one wave to the next",
        },
    ],
    statistic: "bias",
    axis: "row",
    confused_with: "row-noise, which is afresh in every frame",
    reference: "mains hum",
    ..Card::BASE
};

impl Effect for RowRipple {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let (amplitude, period, width) = (settings.at(0), settings.at(1), exposure.seen.width);
        exposure.shift_disparity(|i| amplitude * (TAU * (i / width) as f64 / period).sin());
    }

    fn shapes(&self, bounds: &Bounds) -> Vec<Basis> {
        let period = |half_cycles| 2.0 * bounds.camera.height as f64 / f64::from(half_cycles);
        (6..=24).map(|half_cycles| hum(period(half_cycles))).collect()
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let Some(period) = fit.shape.period() else { return Vec::new() };
        let at = |t: f64| PixelContext { v: t * period, ..PixelContext::default() };
        vec![
            fit.estimate("amplitude_px", &|b| greatest(|t| fit.value(b, at(t)))),
            Estimate::given("period_px", period, 0.02 * period),
        ]
    }

    fn term(&self, known: Known, _: &Camera) -> Option<Term> {
        Some(Term::bias(hum(known("period_px")?), vec![UNITS_A_PX * known("amplitude_px")?, 0.0]))
    }

    fn smallest(&self, bounds: &Bounds) -> Option<Smallest> {
        let shape = hum(bounds.camera.height as f64 / 4.0);
        let unit = vec![UNITS_A_PX, 0.0];
        Some(Smallest { parameter: "amplitude_px", shape, unit, of: |a| a })
    }
}

/// Stripes are counted in fifths of a px.
const UNITS_A_PX: f64 = 5.0;

fn hum(period_px: f64) -> Basis {
    Basis::waves(Coordinate::Row, period_px, 1)
}
