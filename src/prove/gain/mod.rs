//! The examination: how much better than the model file does somebody predict views they never
//! saw, against somebody who knows the truth?
//!
//! The score is exact, without drawing noise. A user corrects the depth and fits a plane, so errors
//! that a plane takes up cost nothing; what is left, e, and the true noise, sigma, are scored under
//! the predicted noise s:
//!
//! ```text
//! E[log N(e + noise; 0, s^2)] = -(e^2 + sigma^2) / (2 s^2) - ln s   (+ a constant)
//! ```

mod model;
mod score;
mod stand;
#[cfg(test)]
pub(super) mod tests;

pub(crate) use model::MOST_LOG_VARIANCE;
pub use model::ModelPredictor;
pub use score::{NONE, Oracle, Unaware, gain_of};
pub use stand::{Stand, plane_of};

use std::collections::BTreeMap;
use std::path::Path;

use super::baselines::{self, Tiles};
use super::question::ExamView;
use super::{Gain, Gains, Method};
use crate::error::Result;
use crate::model::NoiseModel;

/// By what name the diagnosis stands among the methods.
pub const DIAGNOSIS: &str = "kinoise";

/// What an examination gives, and what those baselines that know names found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Examined {
    pub gains: Gains,
    /// Ids of the catalogue by baseline.
    pub names: BTreeMap<String, Vec<String>>,
}

/// Examine the model that was `found` from the recording in `folder` (`recording/` beside
/// `model.json` or `simulated/`), and the baselines on the same recording when asked for.
///
/// # Errors
/// When the recording cannot be read, or a prediction does not fit the views.
pub fn examine(
    views: &[ExamView],
    folder: &Path,
    found: &NoiseModel,
    baselines: bool,
) -> Result<Gains> {
    Ok(examine_and_name(views, folder, found, baselines)?.gains)
}

/// As [`examine`], with the names; without views there are names alone.
///
/// # Errors
/// As [`examine`].
pub fn examine_and_name(
    views: &[ExamView],
    folder: &Path,
    found: &NoiseModel,
    baselines: bool,
) -> Result<Examined> {
    let file = folder.join("model.json");
    let given = file.exists().then(|| NoiseModel::read(&file)).transpose()?;
    let mut examined = Examined::default();
    let methods = &mut examined.gains.methods;
    methods.insert(NONE.into(), Method::default());
    if let Some(view) = views.first() {
        let predictor = ModelPredictor::beyond(given.as_ref(), found, &view.sensor)?;
        let gain = gain_of(views, &predictor)?;
        methods.insert(DIAGNOSIS.into(), Method { gain, parameters: predictor.parameters() });
    }
    if baselines {
        let tiles = Tiles::of_folder(folder, given.as_ref().unwrap_or(found))?;
        for baseline in baselines::all() {
            let learnt = baseline.fit(&tiles)?;
            let gain = gain_of(views, learnt.predictor.as_ref())?;
            let name = baseline.name().to_string();
            methods.insert(name.clone(), Method { gain, parameters: learnt.parameters });
            if let Some(names) = learnt.names {
                examined.names.insert(name, names);
            }
        }
    }
    examined.gains.oracle = gain_of(views, &Oracle)?;
    Ok(examined)
}
