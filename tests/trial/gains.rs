//! What an examination gives.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Expected log score beyond that of the model file alone, nats per 1000 pixels, mean over the
/// views. Zero where there is no such view.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// Views like the recording's.
    pub within: f64,
    /// Views outside its distances or tilts.
    pub beyond: f64,
}

/// One way of learning from the recording.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Method {
    pub gain: Gain,
    /// Numbers that were fitted.
    pub parameters: usize,
}

/// All methods beside who knows the truth.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Gains {
    pub oracle: Gain,
    pub methods: BTreeMap<String, Method>,
}
