//! A Python file that needs numpy alone: `sigma()`, `correct()`, `sigma_image()`, `sample()`.

use std::fmt::Write as _;

use super::Exported;
use super::expressions::number;
use super::program::{Line, Program, correction_of, left_out, listed};
use crate::correct::Parts;
use crate::error::Result;
use crate::frame::DepthCode;
use crate::model::NoiseModel;
use crate::view::Sensor;

const PREFIX: &str = "_";
const HELPERS: &str = include_str!("runtime/helpers.py");
const IMAGE: &str = include_str!("runtime/image.py");

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let known = correction_of(model)?;
    let parts = known.as_ref().map(|(_, correction)| correction.parts());
    let program = Program::of(model, parts.as_ref(), PREFIX);
    let mut text = head(model);
    text.push_str(HELPERS);
    text.push_str(&sigma(model, &program));
    if let (Some((sensor, _)), Some(parts)) = (&known, &parts) {
        text.push_str(&constants(sensor, parts));
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
    let notes = left_out(model, known.as_ref().map(|(_, correction)| correction));
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

fn constants(sensor: &Sensor, parts: &Parts<'_>) -> String {
    let camera = parts.camera;
    let mut text = format!("\n\nWIDTH, HEIGHT = {}, {}\n", camera.width, camera.height);
    let distortion = camera.distortion.map(|k| format!("({})", k.map(number).join(", ")));
    let (units, raw, invalid) = match sensor.code {
        DepthCode::Metric { units_per_metre, invalid } => {
            (number(units_per_metre), "None".to_string(), invalid)
        }
        DepthCode::Disparity { offset, slope, invalid } => {
            ("None".into(), format!("({}, {})", number(offset), number(slope)), invalid)
        }
    };
    let drift = |d: &crate::correct::Drift| {
        format!("({}, {})", number(d.relative), number(d.time_constant_s))
    };
    let drifts: Vec<String> = parts.drifts.iter().map(drift).collect();
    let (locking_px, unlocking) = parts.locking.unwrap_or((0.0, &[]));
    let python = |on: bool| if on { "True" } else { "False" }.to_string();
    let lines = [
        ("fx", number(camera.fx)),
        ("fy", number(camera.fy)),
        ("cx", number(camera.cx)),
        ("cy", number(camera.cy)),
        ("distortion", distortion.unwrap_or("None".into())),
        ("scale_px_m", number(parts.scale_px_m)),
        ("units_per_metre", units),
        ("raw_disparity", raw),
        ("invalid", invalid.to_string()),
        ("scale", number(parts.scale)),
        ("drifts", format!("[{}]", drifts.join(", "))),
        ("ray_share", number(parts.ray_share)),
        ("locking_px", number(locking_px)),
        ("unlocking", format!("np.array([\n    {}\n])", listed(unlocking))),
        ("window_limits", format!("np.array([\n    {}\n])", listed(parts.window_limits))),
        ("needs_depth", python(parts.needs.depth)),
        ("needs_slope", python(parts.needs.slope)),
    ];
    for (name, value) in lines {
        let _ = writeln!(text, "{PREFIX}{name} = {value}");
    }
    text
}

/// A list of functions with whether they ask for the temperature.
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
