//! Rewrites a whole folder with the biases removed from its depth images.

use std::path::Path;

use super::correction::Correction;
use super::raw::{RawCode, metric};
pub use super::rewrite::{Corrected, SIGMA_UNITS_PER_METRE, is_uncertainty};
use super::rewrite::{Image, Rewrite, SIGMA_FORMAT, images};
use crate::Progress;
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::io::{
    Assumed, Layout, is_corrected, open_uncut, refuse_full, refuse_inside, write_json,
};
use crate::model::NoiseModel;

/// Options for correcting a recording.
#[derive(Debug, Clone, Copy, Default)]
pub struct CorrectOptions<'a> {
    /// Keeps raw disparities in their code.
    pub keep_code: bool,
    /// Folder for images of the correction's standard uncertainty.
    pub sigma: Option<&'a Path>,
}

/// Copies the recording at `root` to `output` with the biases of `model` removed from its depth images.
/// If nothing described the sensor, recording.json in `output` does. Raw disparities become metric values,
/// finer than the read-out steps, unless `keep_code` is set. Images of the uncertainty have the depth images'
/// names, 16 bits in units of 10 um ([`SIGMA_UNITS_PER_METRE`]), 0 where there is no depth.
/// Fails if `root` is no recording, the model is of another resolution, or `output` is not empty, lies inside
/// `root`, or cannot be written.
pub fn correct_recording(
    root: &Path,
    assumed: &Assumed,
    model: &NoiseModel,
    output: &Path,
    options: &CorrectOptions<'_>,
    progress: Progress<'_>,
) -> Result<Corrected> {
    let keep_code = options.keep_code;
    let layout = Layout::of(root)?;
    for folder in [Some(output), options.sigma].into_iter().flatten() {
        refuse_inside(folder, root)?;
        refuse_full(folder)?;
    }
    let recording = open_uncut(root, assumed)?;
    let sensor = &recording.sensor;
    let images = images(&recording, root)?;
    let mut rewrite = Rewrite {
        root,
        output,
        layout,
        sensor,
        correction: Correction::of(model, sensor).map_err(|e| e.of(root))?,
        table: sensor.code.table(),
        raw: RawCode::of(sensor.code),
        sigma: options.sigma,
    };
    if options.sigma.is_some() && !rewrite.correction.knows_uncertainty() {
        return Err(Error::Argument {
            what: "the model does not say how sure its biases are: none has a covariance or a standard error".into(),
            remedy: "take the model.json of a diagnosis, which has them, or leave out --sigma",
        });
    }
    let disparity = matches!(sensor.code, DepthCode::Disparity { .. });
    if disparity && !keep_code && !rewrite.correction.is_identity() {
        rewrite.raw = RawCode::of(metric(rewrite.max_depth(&images)?));
    }
    std::fs::create_dir_all(output).map_err(|e| Error::write(output, e))?;
    if let Some(folder) = options.sigma {
        std::fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))?;
        let about = serde_json::json!({
            "format": SIGMA_FORMAT,
            "units_per_metre": SIGMA_UNITS_PER_METRE,
            "invalid": 0,
        });
        write_json(&folder.join("sigma.json"), &about, "report this as a bug")?;
    }
    let mut corrected = rewrite.write(&images, &recording, progress)?;
    let already = |image: &&Image| is_corrected(&image.source.path);
    if let Some(image) = images.first().filter(already).filter(|_| corrected.changed > 0) {
        corrected.remarks.push(format!(
            "{} is corrected already: the model must be of a diagnosis of that, for a bias is taken out once",
            root.join(&image.file).display()
        ));
    }
    Ok(corrected)
}
