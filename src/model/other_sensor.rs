//! Checks whether a model was made of the sensor that it is used on.

use super::file::NoiseModel;
use super::surface::SigmaModel;
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::sensors::KINECT_BASELINE_M;
use crate::units::shortest;
use crate::view::Sensor;

/// Relative difference above which baselines or focal lengths are not the same sensor's.
const SAME_SENSOR: f64 = 0.01;
/// Relative change of sigma by rounding that is within the uncertainty of any calibration.
const SAME_SIGMA: f64 = 0.05;

impl NoiseModel {
    /// Fails when the model is of a sensor of another resolution: errors are located by pixel.
    pub fn refuse_other_size(&self, sensor: &Sensor) -> Result<()> {
        let Some(own) = &self.sensor else { return Ok(()) };
        let [[mw, mh], [w, h]] = [&own.camera, &sensor.camera].map(|c| [c.width, c.height]);
        if [mw, mh] == [w, h] {
            return Ok(());
        }
        Err(Error::Argument {
            what: format!(
                "the model's sensor has {mw} x {mh} px, the recording's {w} x {h}: its errors lie elsewhere"
            ),
            remedy: "give the model that was made of this very sensor",
        })
    }

    /// Signs that the model was made of another sensor than this one, in clauses.
    pub fn differences(&self, sensor: &Sensor) -> Vec<String> {
        let own = self.sensor.clone().and_then(|own| own.sensor().ok());
        own.map_or_else(Vec::new, |own| differences(&own, sensor, &self.sigma))
    }
}

fn differences(model: &Sensor, sensor: &Sensor, sigma: &SigmaModel) -> Vec<String> {
    let far = |a: f64, b: f64| (a / b - 1.0).abs() > SAME_SENSOR;
    let mut differences = Vec::new();
    if let (Some(a), Some(b)) = (&model.serial, &sensor.serial)
        && a != b
    {
        differences.push(format!("the model is of unit {a}, the recording of unit {b}"));
    }
    let (a, b) = (&model.camera, &sensor.camera);
    if far(a.fx, b.fx) || far(a.fy, b.fy) {
        differences.push(format!(
            "the model's focal lengths are {:.1}, {:.1} px, the recording's {:.1}, {:.1}",
            a.fx, a.fy, b.fx, b.fy
        ));
    }
    let of = |s: &Sensor| s.baseline_m.unwrap_or(KINECT_BASELINE_M);
    if far(of(model), of(sensor)) {
        let in_words = |s: &Sensor| {
            let stated = if s.baseline_m.is_some() { "" } else { " (assumed)" };
            format!("{} m{stated}", of(s))
        };
        let [a, b] = [model, sensor].map(in_words);
        differences.push(format!("the model's baseline is {a}, the recording's {b}"));
    }
    differences.extend(rounding(model.code, sensor.code, sigma));
    differences
}

/// Compares the rounding of the depth codes, which is part of sigma.
fn rounding(model: DepthCode, sensor: DepthCode, sigma: &SigmaModel) -> Option<String> {
    let [near, far] = sigma.domain.z_m;
    let z = (near * far).sqrt();
    let step_m = |code: DepthCode| code.step_inverse(z) * z * z;
    // The variance of rounding is step^2/12.
    let [a, b] = [model, sensor].map(|code| step_m(code).powi(2) / 12.0);
    let change = (a - b).abs() / sigma.axial_sigma(z, 0.0).powi(2);
    // The standard deviation changes by half of that, to first order.
    (change > 2.0 * SAME_SIGMA).then(|| {
        format!(
            "the model's depth is stored {} (steps of {:.1} mm at {z:.1} m), the recording's {} ({:.1} mm)",
            described(model),
            1e3 * step_m(model),
            described(sensor),
            1e3 * step_m(sensor)
        )
    })
}

fn described(code: DepthCode) -> String {
    match code {
        DepthCode::Metric { units_per_metre, .. } => {
            format!("in {} units per metre", shortest(units_per_metre))
        }
        DepthCode::Disparity { .. } => "as raw disparities".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;

    fn sensor(focal_px: f64, code: DepthCode) -> Sensor {
        let (fx, fy, cx, cy) = (focal_px, focal_px, 319.5, 239.5);
        Sensor {
            name: "a".into(),
            serial: None,
            mode: None,
            camera: Camera { width: 640, height: 480, fx, fy, cx, cy, distortion: None },
            baseline_m: Some(0.075),
            code,
            intrinsics_uncertainty: None,
            kind: None,
        }
    }

    const RAW: DepthCode =
        DepthCode::Disparity { offset: 3.3309495161, slope: -0.0030711016, invalid: 2047 };
    const fn metric(units_per_metre: f64) -> DepthCode {
        DepthCode::Metric { units_per_metre, invalid: 0 }
    }

    #[test]
    fn another_camera_is_known_by_its_focal_length_and_its_steps() {
        let between = |a: &Sensor, b: &Sensor| differences(a, b, &SigmaModel::paper());
        let raw = sensor(585.0, RAW);
        assert_eq!(between(&raw, &sensor(588.0, RAW)), Vec::<String>::new());
        let other = between(&raw, &sensor(517.3, RAW));
        assert!(matches!(&other[..], [one] if one.contains("585.0, 585.0 px")), "{other:?}");
        let unstated = Sensor { baseline_m: None, ..raw.clone() };
        assert_eq!(between(&raw, &unstated), Vec::<String>::new());
        let short = Sensor { baseline_m: Some(0.05), ..raw.clone() };
        let other = between(&unstated, &short);
        assert!(matches!(&other[..], [one] if one.contains("0.075 m (assumed)")), "{other:?}");
        // A Kinect's step at 2 m is 12.3 mm, whose rounding is 3.5 mm of Eq. 1's 6.5.
        let coded = between(&raw, &sensor(585.0, metric(5000.0)));
        assert!(
            matches!(&coded[..], [one] if one.contains("steps of 12.3 mm at 2.0 m")),
            "{coded:?}"
        );
        // Millimetres or fifths of them: both round by far less than sigma.
        let [mm, fifths] = [1000.0, 5000.0].map(|units| sensor(585.0, metric(units)));
        assert_eq!(between(&mm, &fifths), Vec::<String>::new());
    }
}
