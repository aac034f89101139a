//! What an effect and those who look for it, or take it out again, say to each other.

use crate::camera::Camera;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Extent, Term};

/// What a recording can show.
#[derive(Debug, Clone, Copy)]
pub struct Bounds<'a> {
    pub camera: &'a Camera,
    pub reach: &'a Extent,
    /// Side of the smallest patch that is looked at, px.
    pub patch_px: f64,
    /// What is stated of the target's surface.
    pub flat: Option<Flat>,
    /// Of the camera, where it is known.
    pub kind: Option<SensorKind>,
}

/// A target that is stated to be flat, and how much of it was seen, m, about its middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flat {
    /// Distance of the two parallel planes that hold its surface, m.
    pub flatness_m: f64,
    pub right: [f64; 2],
    pub down: [f64; 2],
}

/// Parameters by name, as far as they are known.
pub type Known<'a> = &'a dyn Fn(&str) -> Option<f64>;

/// What undoes an effect in a depth image.
#[derive(Debug, Clone, PartialEq)]
pub enum Inverse {
    /// Taken off the disparity.
    Term(Term),
    /// Stored depth over true depth.
    Scale(f64),
    /// Stored depth over true depth rises by `relative` in the course of a session.
    Drift { relative: f64, time_constant_s: f64 },
    /// Depth holds this share of what the ray is longer than the depth.
    AlongRay { share: f64 },
    /// Whole columns step, differently in every image, which shows how (`measure::ColumnSteps`).
    ColumnSteps,
    /// Disparity is drawn to whole pixels by a sine of this height.
    Locking { amplitude_px: f64 },
}

/// How the smallest effect that a recording could have shown is told.
#[derive(Debug, Clone)]
pub struct Smallest {
    pub parameter: &'static str,
    pub shape: Basis,
    /// The direction in which the shape's coefficients grow with the effect.
    pub unit: Vec<f64>,
    /// The parameter, of so many units.
    pub of: fn(f64) -> f64,
}
