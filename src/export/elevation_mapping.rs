//! Parameters of elevation_mapping's structured-light sensor processor (ANYbotics).
//!
//! It takes a standard deviation along the optical axis of a + b (z - c)^2 + d z^e, and one across it
//! of lateral_factor z (elevation_mapping/src/sensor_processors/StructuredLightSensorProcessor.cpp).

use super::Exported;
use super::expressions::yaml_float;
use super::tables::even;
use crate::error::Result;
use crate::model::{Direction, Form, NoiseModel, SigmaModel};

/// Depths at which a form that the processor lacks is fitted, and the fit is checked.
const NODES: usize = 201;

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let sigma = &model.sigma;
    let theta = sigma.domain.theta_rad[0];
    let factors = exact(sigma, theta).unwrap_or_else(|| fitted(sigma, theta));
    let lateral = model.described_sensor()?.map(|s| 1.0 / (12f64.sqrt() * s.camera.fx));
    let [near, far] = sigma.domain.z_m;
    let [a, b, c, d, e] = factors;
    let parameters = [
        ("normal_factor_a", a),
        ("normal_factor_b", b),
        ("normal_factor_c", c),
        ("normal_factor_d", d),
        ("normal_factor_e", e),
        ("lateral_factor", lateral.unwrap_or(0.0)),
        ("cutoff_min_depth", near),
        ("cutoff_max_depth", far),
    ];
    let mut text = String::from("sensor_processor:\n  type: structured_light\n");
    for (name, value) in parameters {
        text.push_str(&format!("  {name}: {}\n", yaml_float(value)));
    }
    let mut notes = vec![
        format!(
            "the processor knows no tilt: the noise is that of surfaces at {:.0} degrees, and of steeper ones more",
            theta.to_degrees()
        ),
        match lateral {
            Some(_) => {
                "lateral_factor is a pixel's footprint (a uniform place within it), not measured"
                    .into()
            }
            None => "the model has no sensor: lateral_factor is 0".into(),
        },
        format!("beyond {near:.2} to {far:.2} m points are cut off: there sigma was not measured"),
    ];
    let worst = worst(sigma, theta, &factors);
    // The exact forms differ by rounding alone.
    if worst > 1e-9 {
        notes.push(format!(
            "the form {} is none of the processor's: fitted, off by {:.1} % at most",
            sigma.form,
            1e2 * worst
        ));
    }
    if !model.effects.is_empty() {
        notes.push("the model's effects have no place there".into());
    }
    Ok(Exported { bytes: text.into_bytes(), notes })
}

/// Parameters a to e of a form that the processor has, at one tilt; otherwise `None`.
fn exact(sigma: &SigmaModel, theta: f64) -> Option<[f64; 5]> {
    let p = &sigma.parameters;
    let tilt = |pole: f64| (theta / (pole - theta)).powi(2);
    let [a, b, c, d, e] = match sigma.form {
        Form::Paper => [p[0], p[1], p[2], p[3] * tilt(p[5]), p[4]],
        Form::Nguyen => [p[0], p[1], p[2], p[3] * tilt(std::f64::consts::FRAC_PI_2), -0.5],
        Form::Khoshelham => [0.0, p[0], 0.0, 0.0, 0.0],
        Form::Disparity => return None,
    };
    let across = match sigma.direction {
        Direction::Axial => 1.0,
        Direction::Perpendicular => theta.cos(),
    };
    Some([a / across, b / across, c, d / across, e])
}

/// Fits a + b z^2 by least squares of the relative error.
fn fitted(sigma: &SigmaModel, theta: f64) -> [f64; 5] {
    let mut sums = [0.0; 5];
    for z in even(sigma.domain.z_m, NODES) {
        let s = sigma.axial_sigma(z, theta);
        let (x, y) = (1.0 / s, z * z / s);
        [x * x, x * y, y * y, x, y].iter().zip(&mut sums).for_each(|(v, sum)| *sum += v);
    }
    let [xx, xy, yy, x, y] = sums;
    let determinant = xx * yy - xy * xy;
    [(yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant, 0.0, 0.0, 0.0]
}

/// Largest relative error of the processor's formula.
fn worst(sigma: &SigmaModel, theta: f64, [a, b, c, d, e]: &[f64; 5]) -> f64 {
    let off = |z: f64| {
        let processor = a + b * (z - c) * (z - c) + d * z.powf(*e);
        (processor / sigma.axial_sigma(z, theta) - 1.0).abs()
    };
    even(sigma.domain.z_m, NODES).into_iter().map(off).fold(0.0, f64::max)
}
