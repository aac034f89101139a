//! A Python file that needs only numpy: `sigma()`, `correct()`, `sigma_image()`, `sample()`.

use std::fmt::Write as _;

use super::Exported;
use super::expressions::number;
use super::program::{Line, Program, correction_of, left_out, listed};
use crate::correct::{Correction, Drift};
use crate::error::Result;
use crate::frame::DepthCode;
use crate::model::NoiseModel;
use crate::view::Sensor;

const PREFIX: &str = "_";
const HELPERS: &str = include_str!("runtime/helpers.py");
const IMAGE: &str = include_str!("runtime/image.py");

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let known = correction_of(model)?;
    let correction = known.as_ref().map(|(_, correction)| correction);
    let program = Program::of(model, correction, PREFIX);
    let mut text = head(model);
    text.push_str(HELPERS);
    text.push_str(&sigma(model, &program));
    if let Some((sensor, correction)) = &known {
        text.push_str(&constants(sensor, correction));
        for (k, table) in program.expressions.tables.iter().enumerate() {
            let name = program.expressions.name(k);
            let _ = writeln!(text, "{name} = np.array([\n    {}\n])", listed(table));
        }
        let lists =
            [("still", &program.still), ("bias", &program.bias), ("variance", &program.variance)];
        for (name, lines) in lists {
            text.push_str(&terms(name, lines));
        }
        text.push_str("\n\n");
        text.push_str(IMAGE);
    }
    let notes = left_out(model, correction);
    Ok(Exported { bytes: text.into_bytes(), notes })
}

fn head(model: &NoiseModel) -> String {
    let sensor = model.sensor.as_ref().map_or("a sensor", |s| &s.sensor);
    format!(
        "\"\"\"Noise and biases of {}: a model that kinoise measured, as a program.\n\n\
         Depths in m along the optical axis, tilts in rad between axis and surface normal.\n\
         \"\"\"\n\
         from types import SimpleNamespace\n\n\
         import numpy as np\n\
         from numpy import cos, exp, hypot, log, log1p, sin, sqrt, tan\n\n\
         fmax, fmin, pow = np.maximum, np.minimum, np.power\n\n\n",
        sensor.replace(['\\', '"'], "'")
    )
}

fn sigma(model: &NoiseModel, program: &Program) -> String {
    let ([z0, z1], [t0, t1]) = (model.sigma.domain.z_m, model.sigma.domain.theta_rad);
    let [z0, z1, t0, t1] = [z0, z1, t0, t1].map(number);
    format!(
        "\n\nZ_M = ({z0}, {z1})\nTHETA_RAD = ({t0}, {t1})\n\n\n\
         def sigma(z, theta):\n    \
         \"\"\"Standard deviation of depth, m; beyond Z_M and THETA_RAD, its value at the edge.\"\"\"\n    \
         z = np.clip(np.asarray(z, float), {z0}, {z1})\n    \
         theta = np.clip(np.abs(np.asarray(theta, float)), {t0}, {t1})\n    \
         return {} + 0.0 * theta\n",
        program.sigma
    )
}

fn constants(sensor: &Sensor, correction: &Correction) -> String {
    let camera = &correction.camera;
    let mut text = format!("\n\nWIDTH, HEIGHT = {}, {}\n", camera.width, camera.height);
    let distortion = camera.distortion.map(|k| format!("({})", k.map(number).join(", ")));
    let (units, raw) = match sensor.code {
        DepthCode::Metric { units_per_metre, .. } => (number(units_per_metre), "None".to_string()),
        DepthCode::Disparity { offset, slope, .. } => {
            ("None".into(), format!("({}, {})", number(offset), number(slope)))
        }
    };
    let drift = |d: &Drift| format!("({}, {})", number(d.relative), number(d.time_constant_s));
    let drifts: Vec<String> = correction.drifts.iter().map(drift).collect();
    let python = |on: bool| if on { "True" } else { "False" }.to_string();
    let lines = [
        ("fx", number(camera.fx)),
        ("fy", number(camera.fy)),
        ("cx", number(camera.cx)),
        ("cy", number(camera.cy)),
        ("distortion", distortion.unwrap_or("None".into())),
        ("scale_px_m", number(correction.scale_px_m)),
        ("units_per_metre", units),
        ("raw_disparity", raw),
        ("invalid", sensor.code.invalid().to_string()),
        ("raw_end", sensor.code.end().to_string()),
        ("scale", number(correction.scale)),
        ("drifts", format!("[{}]", drifts.join(", "))),
        ("ray_share", number(correction.ray_share)),
        ("locking_px", number(correction.locking_px)),
        ("unlocking", format!("np.array([\n    {}\n])", listed(&correction.unlocking))),
        ("window_limits", format!("np.array([\n    {}\n])", listed(correction.noise.limits()))),
        ("needs_depth", python(correction.needs.depth)),
        ("needs_slope", python(correction.needs.slope)),
    ];
    for (name, value) in lines {
        let _ = writeln!(text, "{PREFIX}{name} = {value}");
    }
    text
}

/// A list of functions, each with whether it needs the temperature.
fn terms(name: &str, lines: &[Line]) -> String {
    let mut text = format!("{PREFIX}{name}_terms = [\n");
    for Line { expression, held, asks_temperature } in lines {
        let term = format!("lambda p: {expression}");
        let term = match held {
            Some([low, high]) => {
                let [low, high] = [low, high].map(|d| number(*d));
                format!("lambda p: ({term})({PREFIX}hold(p, {low}, {high}))")
            }
            None => term,
        };
        let asks = if *asks_temperature { "True" } else { "False" };
        let _ = writeln!(text, "    ({term}, {asks}),");
    }
    text.push_str("]\n");
    text
}
