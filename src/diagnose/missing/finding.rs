//! Losses that follow something, as they are told.

use serde_json::{Map, Value};

use crate::diagnose::diagnosis::Curve;
use crate::terms::Axis;

/// Losses that follow an axis.
#[derive(Debug, Clone)]
pub struct DropoutFinding {
    /// Id in the catalogue; `None` where no family explains it.
    pub family: Option<&'static str>,
    pub axis: Axis,
    /// Where it matters, in the axis's unit.
    pub interval: [f64; 2],
    /// As the catalogue names them, each with value and standard error.
    pub parameters: Map<String, Value>,
    /// Chance that losses without a cause look as much like it anywhere in this layer.
    pub p: f64,
    /// Families and nameless axes beside it, nats, best first.
    pub rivals: Vec<(&'static str, f64)>,
    /// Nats on held-out views.
    pub gain: f64,
    /// Share of all pixel-frames that it took.
    pub size: f64,
    /// Each half of the views alone has it.
    pub replicated: Option<bool>,
    /// When it began, where it did so in the midst of the session, s.
    pub since_s: Option<f64>,
    /// Lost share over the axis.
    pub curve: Curve,
}

/// A name must explain this share of what the best nameless curve does.
pub const NAME_ADEQUATE: f64 = 0.6;
