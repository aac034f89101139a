//! Uncertainty budgets that a calibration writes into `model.json`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::stats::Budget;

/// Statement that a budget is no test by these standards, which prescribe artefacts, positions and limits.
pub const NO_ACCEPTANCE_TEST: &str = "a statement of uncertainty after the GUM (JCGM 100:2008), no acceptance or reverification \
    test after VDI/VDE 2634 or ISO 10360-13";

/// Budgets by view, and under which conditions they hold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Uncertainty {
    /// What it is, and what it is not.
    pub statement: String,
    pub coverage_factor: f64,
    pub conditions: Conditions,
    /// Keys of recording.json and view.json that would add rows and are missing, in all views or some.
    pub not_stated: Vec<String>,
    pub views: Vec<ViewUncertainty>,
}

/// Under which the views were taken; least and greatest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Conditions {
    pub views: usize,
    pub frames: [usize; 2],
    pub distance_m: [f64; 2],
    pub tilt_rad: [f64; 2],
    /// From the first view's first frame to the last view's, s.
    pub duration_s: f64,
    /// Null where no view states it, as the light.
    pub temperature_c: Option<[f64; 2]>,
    pub ambient_lux: Option<[f64; 2]>,
}

/// Of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ViewUncertainty {
    pub view: String,
    /// The error of indication: depth of the plane on the optical axis minus the reference distance; null
    /// where no uncertainty of the reference is stated.
    pub distance_error: Option<Budget>,
    /// The spatial standard deviation of one frame, along the optical axis.
    pub sigma: Budget,
}
