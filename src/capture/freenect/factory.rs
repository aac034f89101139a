//! What is known about a Kinect v1 before it is calibrated.

use super::ffi::{HEIGHT, WIDTH, ZeroPlane};
use crate::camera::Camera;
use crate::frame::{DepthCode, KINECT_NO_MEASUREMENT};
use crate::io::Assumed;
use crate::sensors::{KINECT_BASELINE_M, OPENKINECT};
use crate::view::Sensor;

/// fx, fy, cx, cy of the depth camera, px, as in libfreenect's own point-cloud viewer (examples/glpclview.c,
/// after Nicolas Burrus's calibration of one unit).
const INTRINSICS: [f64; 4] = [594.21, 591.04, 339.5, 242.7];
/// libfreenect places the optical axis in the middle of 640 x 480 px (freenect_camera_to_world).
const FACTORY_CENTRE: [f64; 2] = [320.0, 240.0];
/// Infrared columns per depth pixel: the infrared camera has 1280, and depth uses every second one.
const COLUMNS_A_PIXEL: f64 = 2.0;
/// Raw values per pixel, and the matcher's offset, px: libfreenect's registration.c.
const RAW_A_PIXEL: f64 = 4.0;
const OFFSET_PX: f64 = 0.375;

/// Intrinsics, depth code and baseline, m, from a unit's memory; `None` if they are implausible.
///
/// libfreenect converts a raw value to a shift m = ((raw - 4 s)/4 - 0.375) p on the reference plane at
/// distance R, where p is the size of a pixel there and s the unit's shift. With the projector at distance E,
/// z = R E / (E - m), lengths in cm. So 1/z is affine in the raw value, and f = R / p in infrared pixels.
pub fn of_factory(plane: &ZeroPlane, const_shift: f64) -> Option<([f64; 4], DepthCode, f64)> {
    let [emitter, reference, pixel] =
        [plane.emitter_distance, plane.reference_distance, plane.reference_pixel_size]
            .map(f64::from);
    let sensible = (5.0..10.0).contains(&emitter)
        && (60.0..200.0).contains(&reference)
        && (0.03..0.3).contains(&pixel)
        && (50.0..400.0).contains(&const_shift);
    if !sensible {
        return None;
    }
    let per_metre = 100.0 / (reference * emitter);
    let slope = -per_metre * pixel / RAW_A_PIXEL;
    let offset = per_metre * (emitter + pixel * (const_shift + OFFSET_PX));
    let focal = reference / (COLUMNS_A_PIXEL * pixel);
    let [cx, cy] = FACTORY_CENTRE;
    let code = DepthCode::Disparity { offset, slope, invalid: KINECT_NO_MEASUREMENT };
    Some(([focal, focal, cx, cy], code, emitter / 100.0))
}

/// The sensor as recording.json describes it: from what the user gives, else from the factory's values, else
/// from those that OpenKinect publishes.
pub fn sensor(
    serial: Option<String>,
    factory: Option<(ZeroPlane, f64)>,
    assumed: &Assumed,
) -> (Sensor, Vec<String>) {
    let factory = factory.and_then(|(plane, shift)| of_factory(&plane, shift));
    let mut remarks = Vec::new();
    let missing = match (assumed.intrinsics.is_some(), assumed.code.is_some()) {
        (true, true) => None,
        (false, false) => Some(("calibration", "--intrinsics and --raw-disparity")),
        (true, false) => Some(("depth formula", "--raw-disparity")),
        (false, true) => Some(("intrinsics", "--intrinsics")),
    };
    if let Some((what, options)) = missing.filter(|_| factory.is_none()) {
        remarks.push(format!(
            "the sensor tells no {what}: what OpenKinect published is written; give {options} if you know this unit's"
        ));
    }
    let (intrinsics, code, baseline_m) =
        factory.unwrap_or((INTRINSICS, OPENKINECT, KINECT_BASELINE_M));
    let [fx, fy, cx, cy] = assumed.intrinsics.unwrap_or(intrinsics);
    let sensor = Sensor {
        name: "Kinect for Xbox 360".into(),
        serial,
        mode: Some("normal".into()),
        camera: Camera { width: WIDTH, height: HEIGHT, fx, fy, cx, cy, distortion: None },
        baseline_m: Some(assumed.baseline_m.unwrap_or(baseline_m)),
        code: assumed.code.unwrap_or(code),
        intrinsics_uncertainty: None,
        kind: None,
    };
    (sensor, remarks)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// libfreenect's own defaults, and its formula as registration.c computes it, in mm.
    fn libfreenect_mm(raw: u16) -> f64 {
        let fixed = (f64::from(raw) - 4.0 * 200.0) / 4.0 - 0.375;
        let metric = fixed * 0.1042;
        10.0 * (metric * 120.0 / (7.5 - metric) + 120.0)
    }

    #[test]
    fn raw_values_become_the_depth_libfreenect_gives_them() {
        let plane = ZeroPlane {
            emitter_distance: 7.5,
            colour_distance: 2.3,
            reference_distance: 120.0,
            reference_pixel_size: 0.1042,
        };
        let ([fx, ..], code, baseline) = of_factory(&plane, 200.0).expect("sensible");
        assert!((fx - 575.8).abs() < 0.05, "OpenNI's focal length: {fx}");
        assert!((baseline - 0.075).abs() < 1e-9);
        for raw in [400u16, 600, 800, 950, 1020] {
            let z = code.metres(raw).expect("a depth");
            // The floats of the C structure carry seven digits.
            assert!((1e3 * z / libfreenect_mm(raw) - 1.0).abs() < 1e-5, "{raw}: {z}");
        }
        assert!(of_factory(&ZeroPlane { reference_pixel_size: 0.0, ..plane }, 200.0).is_none());
    }
}
