//! The place where what was learnt is weighed: after the seals are open.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::gains::Gains;
use crate::raytraced::question::Sealed;
use kinoise::error::Result;
use kinoise::model::NoiseModel;

/// Under this name the diagnosis itself stands among the methods.
pub const OUR_METHOD: &str = "kinoise";

/// What an examination of one set finds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Examination {
    /// None where the world has no truth without noise.
    pub gains: Option<Gains>,
    /// Ids of the catalogue by baseline, best first, of those baselines that give names.
    #[serde(default)]
    pub names: BTreeMap<String, Vec<String>>,
}

/// Who examines: the opened set, its folder as the solver had it, and the model that the diagnosis
/// wrote.
pub type Examine = fn(&dyn Sealed, &Path, &NoiseModel) -> Result<Examination>;

/// The baselines learn from one set in so many, by the set's seed: they take longer than all else.
const BASELINES_IN: u64 = 3;

/// Our model on one set by fresh views, where its world can give such, and on every third set the
/// baselines beside it.
///
/// # Errors
/// When the recording cannot be read, or a prediction does not fit the views.
pub fn examine_all(sealed: &dyn Sealed, folder: &Path, found: &NoiseModel) -> Result<Examination> {
    let baselines = sealed.truth().asked.seed.is_multiple_of(BASELINES_IN);
    super::gain::examine_and_name(&sealed.exam(), folder, found, baselines)
}
