//! A C99 header: `kinoise_sigma()`, `kinoise_correct()`, `kinoise_sigma_image()`, `kinoise_sample()`.

use std::fmt::Write as _;

use super::Exported;
use super::expressions::number;
use super::program::{Line, Program, correction_of, left_out, listed};
use crate::correct::Correction;
use crate::error::Result;
use crate::frame::DepthCode;
use crate::model::NoiseModel;
use crate::terms::ROOM_LUX;
use crate::view::Sensor;

const PREFIX: &str = "kinoise_";
const HELPERS: &str = include_str!("runtime/helpers.h");
const PLACE: &str = include_str!("runtime/place.h");
const IMAGE: &str = include_str!("runtime/image.h");

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let known = correction_of(model)?;
    let correction = known.as_ref().map(|(_, correction)| correction);
    let program = Program::of(model, correction, PREFIX);
    let mut text = head(model);
    text.push_str(HELPERS);
    text.push_str(&sigma(model, &program));
    if let Some((sensor, correction)) = &known {
        text.push_str(PLACE);
        text.push_str(&constants(sensor, correction, &program));
        for (k, table) in program.expressions.tables.iter().enumerate() {
            text.push_str(&array(&program.expressions.name(k), table));
        }
        text.push_str(&sum("still", &program.still, "kinoise_place p"));
        text.push_str(&sum("bias", &program.bias, "kinoise_place p, int temperature"));
        text.push_str(&sum("log_variance", &program.variance, "kinoise_place p, int temperature"));
        text.push('\n');
        text.push_str(IMAGE);
    }
    text.push_str("\n#endif\n");
    let notes = left_out(model, correction);
    Ok(Exported { bytes: text.into_bytes(), notes })
}

fn head(model: &NoiseModel) -> String {
    let sensor = model.sensor.as_ref().map_or("a sensor", |s| &s.sensor);
    let sensor: String =
        sensor.chars().filter(|c| c.is_alphanumeric() || " ._()-".contains(*c)).collect();
    format!(
        "/* Noise and biases of {sensor}: a model that kinoise measured, as a C99 header.\n \
         * Depths in m along the optical axis, tilts in rad between axis and surface normal. */\n\
         #ifndef KINOISE_SENSOR_MODEL_H\n#define KINOISE_SENSOR_MODEL_H\n\n\
         #include <float.h>\n#include <math.h>\n#include <stdlib.h>\n\n"
    )
}

fn sigma(model: &NoiseModel, program: &Program) -> String {
    let ([z0, z1], [t0, t1]) = (model.sigma.domain.z_m, model.sigma.domain.theta_rad);
    let [z0, z1, t0, t1] = [z0, z1, t0, t1].map(number);
    format!(
        "\n/* Standard deviation of depth, m, from {z0} to {z1} m and {t0} to {t1} rad; beyond, its value\n \
         * at the edge. */\n\
         static inline double kinoise_sigma(double z, double theta)\n{{\n    \
         z = kinoise_clamp(z, {z0}, {z1});\n    \
         theta = kinoise_clamp(fabs(theta), {t0}, {t1});\n    \
         return {};\n}}\n\n",
        program.sigma
    )
}

fn array(name: &str, numbers: &[f64]) -> String {
    let numbers = if numbers.is_empty() { &[0.0] } else { numbers };
    format!("static const double {name}[{}] = {{\n    {}\n}};\n", numbers.len(), listed(numbers))
}

fn constants(sensor: &Sensor, correction: &Correction, program: &Program) -> String {
    let camera = &correction.camera;
    let (units, offset, slope, raw) = match sensor.code {
        DepthCode::Metric { units_per_metre, .. } => (units_per_metre, 0.0, 1.0, 0),
        DepthCode::Disparity { offset, slope, .. } => (1.0, offset, slope, 1),
    };
    let counts = [
        ("WIDTH", camera.width),
        ("HEIGHT", camera.height),
        ("DRIFTS", correction.drifts.len()),
        ("UNLOCKING", correction.unlocking.len()),
        ("BIAS_TERMS", program.bias.len()),
        ("VARIANCE_TERMS", program.variance.len()),
        ("NEEDS_DEPTH", usize::from(correction.needs.depth)),
        ("NEEDS_SLOPE", usize::from(correction.needs.slope)),
        ("RAW_DISPARITY", raw),
    ];
    let scalars = [
        ("fx", camera.fx),
        ("fy", camera.fy),
        ("cx", camera.cx),
        ("cy", camera.cy),
        ("has_distortion", f64::from(u8::from(camera.distortion.is_some()))),
        ("scale_px_m", correction.scale_px_m),
        ("room_lux", ROOM_LUX),
        ("scale", correction.scale),
        ("ray_share", correction.ray_share),
        ("locking_px", correction.locking_px),
        ("units_per_metre", units),
        ("raw_offset", offset),
        ("raw_slope", slope),
        ("invalid", f64::from(sensor.code.invalid())),
        ("raw_end", f64::from(sensor.code.end())),
    ];
    let mut text = String::from("\n");
    for (name, count) in counts {
        let _ = writeln!(text, "#define KINOISE_{name} {count}");
    }
    for (name, value) in scalars {
        let _ = writeln!(text, "static const double {PREFIX}{name} = {};", number(value));
    }
    let drifts: Vec<f64> =
        correction.drifts.iter().flat_map(|d| [d.relative, d.time_constant_s]).collect();
    for (name, numbers) in [
        ("distortion", &camera.distortion.unwrap_or_default()[..]),
        ("drifts", &drifts),
        ("unlocking", &correction.unlocking),
        ("window_limits", correction.noise.limits()),
    ] {
        text.push_str(&array(&format!("{PREFIX}{name}"), numbers));
    }
    text
}

/// A function that sums terms, each a function of its own.
fn sum(name: &str, lines: &[Line], arguments: &str) -> String {
    let mut text = String::new();
    for (k, line) in lines.iter().enumerate() {
        let _ = write!(
            text,
            "\nstatic inline double {PREFIX}{name}_{k}(kinoise_place p)\n{{\n    (void)p;\n    return {};\n}}\n",
            line.expression
        );
    }
    let _ = write!(
        text,
        "\nstatic inline double {PREFIX}{name}({arguments})\n{{\n    double total = 0.0;\n    (void)p;\n"
    );
    if arguments.contains("temperature") {
        text.push_str("    (void)temperature;\n");
    }
    for (k, Line { held, asks_temperature, .. }) in lines.iter().enumerate() {
        let place = match held {
            Some([low, high]) => format!("{PREFIX}hold(p, {}, {})", number(*low), number(*high)),
            None => "p".into(),
        };
        let asks = if *asks_temperature { "if (temperature)\n        " } else { "" };
        let _ = writeln!(text, "    {asks}total += {PREFIX}{name}_{k}({place});");
    }
    text.push_str("    return total;\n}\n");
    text
}
