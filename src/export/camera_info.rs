//! The YAML of ROS' camera_info_manager (camera_calibration_parsers): the intrinsics.

use super::Exported;
use super::expressions::yaml_float;
use super::tables::known;
use crate::error::Result;
use crate::model::NoiseModel;

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let (sensor, correction) = known(model, "camera_info")?;
    let camera = &sensor.camera;
    let name: String = sensor
        .name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' })
        .collect();
    let matrix = |name: &str, rows: usize, cols: usize, data: &[f64]| {
        let data: Vec<String> = data.iter().copied().map(yaml_float).collect();
        format!("{name}:\n  rows: {rows}\n  cols: {cols}\n  data: [{}]\n", data.join(", "))
    };
    let (fx, fy, cx, cy) = (camera.fx, camera.fy, camera.cx, camera.cy);
    let distortion = camera.distortion.unwrap_or_default();
    let text = [
        format!("image_width: {}\nimage_height: {}\n", camera.width, camera.height),
        format!("camera_name: {name}\n"),
        matrix("camera_matrix", 3, 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        "distortion_model: plumb_bob\n".into(),
        matrix("distortion_coefficients", 1, 5, &distortion),
        matrix("rectification_matrix", 3, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        matrix(
            "projection_matrix",
            3,
            4,
            &[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ),
    ];
    let mut notes =
        vec!["the file holds the intrinsics alone, as the recording gave them: no noise".into()];
    if !correction.is_identity() {
        notes.push("the model's biases of depth have no place in camera_info".into());
    }
    Ok(Exported { bytes: text.concat().into_bytes(), notes })
}
