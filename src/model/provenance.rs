//! Provenance of a model: the views it was fitted to, what was searched in them, and by which program.

use std::time::SystemTime;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// How the surface was fitted.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FitSummary {
    pub views: usize,
    pub samples: usize,
    /// Root mean square of measured minus fitted sigma, m.
    pub rmse_m: f64,
    pub r2: f64,
    /// Root mean square relative error at distances left out of the fit.
    pub heldout: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    /// Where `diagnose` looked for what sigma leaves out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub searched: Option<Searched>,
}

/// What a search rested on: a cause that is too small for it may still be missing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Searched {
    pub views: usize,
    /// Views whose distance was measured by other means.
    pub references: usize,
}

/// Where a model comes from.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Provenance {
    pub tool: String,
    pub version: String,
    pub seed: Option<u64>,
    pub options: Map<String, Value>,
    /// SHA-256 of the inputs, by name.
    pub sha256: Map<String, Value>,
    /// RFC 3339, UTC.
    pub created: String,
}

impl Provenance {
    /// Of this program, at the given time.
    pub fn at(seed: Option<u64>, time: SystemTime) -> Self {
        Provenance {
            tool: "kinoise".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            seed,
            created: humantime::format_rfc3339_seconds(time).to_string(),
            ..Provenance::default()
        }
    }
}
