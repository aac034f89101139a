//! The sensor that is simulated when no model brings its own.

use crate::camera::Camera;
use crate::frame::DepthCode;
use crate::view::Sensor;

/// A Kinect v1 in normal mode, its image `shrink` times smaller each way (1 = 640 x 480).
pub fn kinect_v1(shrink: usize) -> Sensor {
    let s = shrink.max(1) as f64;
    let centre = |n: usize| (n as f64 - 1.0) / 2.0;
    let (width, height) = (640 / shrink.max(1), 480 / shrink.max(1));
    Sensor {
        name: "simulated Kinect v1".into(),
        serial: None,
        mode: Some("normal".into()),
        camera: Camera {
            width,
            height,
            // 580 px: the focal length OpenNI and ROS give a Kinect v1's infrared camera.
            fx: 580.0 / s,
            fy: 580.0 / s,
            cx: centre(width),
            cy: centre(height),
            distortion: None,
        },
        baseline_m: Some(0.075),
        code: DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 },
    }
}
