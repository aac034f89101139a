//! Types shared by effects, the diagnosis that looks for them and the correction that removes them.

use crate::camera::Camera;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Extent, Term};

/// Limits of what a recording can show.
#[derive(Debug, Clone, Copy)]
pub struct Bounds<'a> {
    pub camera: &'a Camera,
    pub reach: &'a Extent,
    /// Side of the smallest patch that is examined, px.
    pub patch_px: f64,
    /// Stated flatness of the target.
    pub flat: Option<Flat>,
    /// Kind of camera, where known.
    pub kind: Option<SensorKind>,
}

/// A target that is stated to be flat, and the extent of it that was seen, m, about its middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flat {
    /// Distance between the two parallel planes that enclose its surface, m.
    pub flatness_m: f64,
    pub right: [f64; 2],
    pub down: [f64; 2],
}

/// What undoes an effect in a depth image.
#[derive(Debug, Clone, PartialEq)]
pub enum Inverse {
    /// Subtracted from the disparity.
    Term(Term),
    /// Stored depth over true depth.
    Scale(f64),
    /// Stored depth over true depth rises by `relative` over a session.
    Drift { relative: f64, time_constant_s: f64 },
    /// Depth contains this share of the excess of ray length over depth.
    AlongRay { share: f64 },
    /// Steps of whole columns, different in every image and estimated from it (`measure::ColumnSteps`).
    ColumnSteps,
    /// Disparity is pulled to whole pixels by a sine of this amplitude.
    Locking { amplitude_px: f64 },
}

/// How to report the smallest effect that a recording could have shown.
#[derive(Debug, Clone)]
pub struct Smallest {
    pub parameter: &'static str,
    pub shape: Basis,
    /// Direction in which the shape's coefficients grow with the effect.
    pub unit: Vec<f64>,
    /// The parameter as a function of the number of units.
    pub of: fn(f64) -> f64,
}
