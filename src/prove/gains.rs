//! What was learnt, weighed on views that nobody saw.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::question::Sealed;
use crate::error::Result;
use crate::model::NoiseModel;

/// Under this name the diagnosis itself stands among the methods.
pub const OUR_METHOD: &str = "kinoise";

/// Log-likelihood gained over the model as it was given, nats a pixel's worth of independent data,
/// the same scale for every method of one set.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// On views inside the distances and tilts of the recording.
    pub within: f64,
    /// On views outside them.
    pub beyond: f64,
    /// How many numbers the method fitted.
    pub parameters: usize,
}

/// Every method's gain on one set, and that of who knows the cause and fits its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gains {
    pub methods: BTreeMap<String, Gain>,
    pub oracle: Gain,
}

/// Who examines, after the seal is open: the set, its folder as the solver had it, and the model
/// that the diagnosis wrote. `None` where the world has no truth without noise.
pub type Examine = fn(&dyn Sealed, &Path, &NoiseModel) -> Result<Option<Gains>>;
