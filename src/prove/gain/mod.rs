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

pub(crate) use model::MAX_LOG_VARIANCE;
pub use model::ModelPredictor;
pub use score::{NONE, Oracle, Unaware, gain_of};
pub use stand::{Stand, plane_of};

use std::collections::BTreeMap;
use std::path::Path;

use super::baselines::{self, Tiles};
use super::examine::{Examination, OUR_METHOD};
use super::question::ExamView;
use super::{Gains, Method};
use crate::error::Result;
use crate::model::NoiseModel;

/// Examine the model that was `found` from the recording in `folder` (`recording/` beside
/// `model.json` or `simulated/`), and the baselines on the same recording when asked for, with the
/// names they give; without views there are names alone.
///
/// # Errors
/// When the recording cannot be read, or a prediction does not fit the views.
pub fn examine_and_name(
    views: &[ExamView],
    folder: &Path,
    found: &NoiseModel,
    baselines: bool,
) -> Result<Examination> {
    let file = folder.join("model.json");
    let given = file.exists().then(|| NoiseModel::read(&file)).transpose()?;
    let (mut gains, mut names_of) = (Gains::default(), BTreeMap::new());
    let methods = &mut gains.methods;
    methods.insert(NONE.into(), Method::default());
    if let Some(view) = views.first() {
        let predictor = ModelPredictor::beyond(given.as_ref(), found, &view.sensor)?;
        let gain = gain_of(views, &predictor)?;
        methods.insert(OUR_METHOD.into(), Method { gain, parameters: predictor.parameters() });
    }
    if baselines {
        let tiles = Tiles::of_folder(folder, given.as_ref().unwrap_or(found))?;
        for baseline in baselines::all() {
            let learnt = baseline.fit(&tiles)?;
            let gain = gain_of(views, learnt.predictor.as_ref())?;
            let name = baseline.name().to_string();
            methods.insert(name.clone(), Method { gain, parameters: learnt.parameters });
            if let Some(names) = learnt.names {
                names_of.insert(name, names);
            }
        }
    }
    gains.oracle = gain_of(views, &Oracle)?;
    let gains = (!views.is_empty()).then_some(gains);
    Ok(Examination { gains, names: names_of })
}
