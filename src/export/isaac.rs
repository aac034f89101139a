//! Isaac Sim's single-view depth sensor, as a USD layer.
//!
//! Attributes of `OmniSensorDepthSensorSingleViewAPI` on a RenderProduct: disparity from baseline and focal
//! length, with Gaussian noise of `noiseSigma` px, constant over patches of `noiseDownscaleFactorPixel`,
//! then rounded to steps of `noiseMean` px (Isaac Sim's `SingleViewDepthSensor`; ovrtx, "Tune Noise,
//! Quantization and Confidence": a step of zero switches both off).

use super::Exported;
use super::expressions::number;
use super::program::once;
use super::tables::{even, known};
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::model::NoiseModel;
use crate::view::Sensor;

const NODES: usize = 201;
/// Step where none is known, px: finer than any matcher's.
const NO_STEP_PX: f64 = 1e-3;

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let (sensor, correction) = known(model, "a depth sensor of Isaac Sim")?;
    let (Some(baseline_m), Some(scale)) = (sensor.baseline_m, sensor.disparity_px_m()) else {
        return Err(Error::Argument {
            what: "the model's sensor has no baseline_m, and Isaac Sim's depth sensor is a stereo camera".into(),
            remedy: "give baseline_m in recording.json and calibrate again",
        });
    };
    let mut notes = Vec::new();
    let step_px = step_px(model, &sensor, scale, &mut notes);
    let [near, far] = model.sigma.domain.z_m;
    let theta = model.sigma.domain.theta_rad[0];
    let px = |z: f64| model.sigma.axial_sigma(z, theta) * scale / (z * z);
    // Evenly spaced in disparity, as a matcher sees them. The steps add noise of their own.
    let sizes: Vec<f64> =
        even([1.0 / far, 1.0 / near], NODES).iter().map(|q| px(1.0 / q)).collect();
    let mean_square = sizes.iter().map(|s| s * s).sum::<f64>() / sizes.len() as f64;
    let sigma_px = (mean_square - step_px * step_px / 12.0).max(0.0).sqrt();
    let [min, max] = crate::stats::range(sizes);
    notes.push(format!(
        "Isaac Sim has one sigma in px: {sigma_px:.3}; the model has {min:.3} to {max:.3} px between {near:.2} and {far:.2} m at {:.0} degrees, and more on steeper surfaces",
        theta.to_degrees()
    ));
    let window = parameter(model, "spatial-correlation", "length_px");
    if !correction.is_identity() {
        notes.push("the model's biases have no place there".into());
    }
    let held = ["spatial-correlation", "disparity-quantisation"];
    let left = model.effects.iter().map(|e| e.id.as_str()).filter(|id| !held.contains(id));
    let left = once(left);
    if !left.is_empty() {
        notes.push(format!("not in the file: {left}"));
    }
    let attributes = [
        ("baselineMM", 1e3 * baseline_m),
        ("focalLengthPixel", sensor.camera.fx),
        ("sensorSizePixel", sensor.camera.width as f64),
        ("maxDisparityPixel", scale / near),
        ("noiseMean", step_px),
        ("noiseSigma", sigma_px),
        ("noiseDownscaleFactorPixel", window.unwrap_or(1.0).max(1.0)),
        ("minDistance", near),
        ("maxDistance", far),
    ];
    let lines: String = attributes
        .iter()
        .map(|(name, v)| format!("    float omni:rtx:post:depthSensor:{name} = {}\n", number(*v)))
        .collect();
    let (width, height) = (sensor.camera.width, sensor.camera.height);
    let text = format!(
        "#usda 1.0\n(\n    defaultPrim = \"DepthSensor\"\n    doc = \"A depth sensor that kinoise measured\"\n)\n\n\
         def RenderProduct \"DepthSensor\" (\n    prepend apiSchemas = [\"OmniSensorDepthSensorSingleViewAPI\"]\n)\n{{\n    \
         bool omni:rtx:post:depthSensor:enabled = 1\n{lines}    uniform int2 resolution = ({width}, {height})\n}}\n"
    );
    Ok(Exported { bytes: text.into_bytes(), notes })
}

/// A parameter of one of the model's effects.
fn parameter(model: &NoiseModel, id: &str, name: &str) -> Option<f64> {
    model.effects.iter().find(|e| e.id == id)?.number(name)
}

/// Disparity step: the matcher's where it was found, else that of the stored values.
fn step_px(model: &NoiseModel, sensor: &Sensor, scale: f64, notes: &mut Vec<String>) -> f64 {
    let found = parameter(model, "disparity-quantisation", "step_px").filter(|step| *step > 0.0);
    match (found, sensor.code) {
        (Some(step), _) => step,
        (None, DepthCode::Disparity { slope, .. }) => slope.abs() * scale,
        (None, DepthCode::Metric { .. }) => {
            notes.push(format!(
                "no step of the disparity is known: noiseMean is {NO_STEP_PX} px, for 0 would switch the noise off"
            ));
            NO_STEP_PX
        }
    }
}
