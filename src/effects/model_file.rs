//! Model files, read with the catalogue at hand: it alone knows what an effect may have.

use std::path::Path;

use super::Active;
use crate::error::Result;
use crate::model::NoiseModel;

impl NoiseModel {
    /// From a `model.json`, or the folder that holds one.
    /// An error when the file is missing, not a model, damaged, or of a newer format; and when an effect
    /// without a fitted shape is not in the catalogue, has a parameter that the catalogue's has not, or one
    /// outside its range: nothing that reads the model would do what it says.
    pub fn read(path: &Path) -> Result<Self> {
        let file = Self::file(path);
        let model = Self::read_unchecked(&file)?;
        Active::check_model(&model.effects).map_err(|e| e.of(&file))?;
        Ok(model)
    }
}
