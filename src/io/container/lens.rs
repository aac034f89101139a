//! Converts the lens of a CameraInfo to k1, k2, p1, p2, k3, the only model that kinoise supports.

use nalgebra::{Matrix3, Vector3};

use super::messages::CameraInfo;

/// The coefficients, `None` for no distortion, and a remark on them.
pub type Lens = (Option<[f64; 5]>, Option<String>);

/// Names of the Brown-Conrady model in ROS and librealsense.
const BROWN: [&str; 2] = ["plumb_bob", "Brown Conrady"];
/// OpenCV's model with eight coefficients, which the drivers of time-of-flight cameras publish.
const RATIONAL: &str = "rational_polynomial";
/// Largest fit error, px: a depth stays in its own pixel. For an Azure Kinect's narrow field
/// of view the error is 0.01 px at the middle of the sides and 0.3 px in the corners, which
/// the camera does not illuminate.
const MAX_ERROR_PX: f64 = 0.5;
/// Radii at which the two models are compared.
const RADII: usize = 500;
/// Tangent of the widest angle searched, and search steps per unit of it.
const MAX_RADIUS: f64 = 3.0;
const STEPS: f64 = 1000.0;

/// Fails if the model is another one and cannot be expressed in these coefficients.
pub fn lens(info: &CameraInfo) -> Result<Lens, String> {
    let k = &info.distortion;
    let (first, rest) = k.split_at(k.len().min(5));
    let rest_is_zero = rest.iter().all(|&k| k == 0.0);
    let mut brown = [0.0; 5];
    brown[..first.len()].copy_from_slice(first);
    if k.iter().all(|&k| k == 0.0) {
        return Ok((None, None));
    }
    let rational = info.model == RATIONAL;
    if (rational || BROWN.contains(&&*info.model)) && rest_is_zero {
        return Ok((Some(brown), None));
    }
    if let (true, [k1, k2, p1, p2, k3, k4, k5, k6, prism @ ..]) = (rational, &k[..])
        && prism.iter().all(|&s| s == 0.0)
        && let Some((k, error_px)) = nearest(info, [*k1, *k2, *k3, *k4, *k5, *k6])
        && error_px <= MAX_ERROR_PX
    {
        let said = format!("its {RATIONAL} lens is met by k1, k2, k3 to {error_px:.2} px");
        return Ok((Some([k[0], k[1], *p1, *p2, k[2]]), Some(said)));
    }
    Err(format!("its lens, \"{}\" {k:?}, cannot be said in k1, k2, p1, p2, k3", info.model))
}

/// Least-squares fit of k1, k2, k3 to the six radial coefficients, weighted by area out to the farthest image
/// corner; and its largest error, px.
fn nearest(info: &CameraInfo, [k1, k2, k3, k4, k5, k6]: [f64; 6]) -> Option<([f64; 3], f64)> {
    // Radial displacement of a ray at radius r.
    let bend = |r: f64| {
        let s = r * r;
        let [over, under] = [[k1, k2, k3], [k4, k5, k6]].map(|[a, b, c]| ((c * s + b) * s + a) * s);
        r * ((1.0 + over) / (1.0 + under) - 1.0)
    };
    let ([fx, fy, cx, cy], (width, height)) = (info.intrinsics, info.size);
    let far = |centre: f64, n: usize| centre.abs().max((n as f64 - 1.0 - centre).abs());
    let corner = (far(cx, width) / fx).hypot(far(cy, height) / fy);
    let radii = (0..(MAX_RADIUS * STEPS) as usize).map(|i| i as f64 / STEPS);
    let edge = radii.into_iter().find(|&r| r + bend(r) >= corner)?;
    let radii = || (1..=RADII).map(|i| edge * i as f64 / RADII as f64);
    let powers = |r: f64| Vector3::new(r.powi(3), r.powi(5), r.powi(7));
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for r in radii() {
        // The area of a ring is proportional to its radius.
        normal += r * powers(r) * powers(r).transpose();
        right += r * bend(r) * powers(r);
    }
    let k = normal.cholesky()?.solve(&right);
    let off = radii().map(|r| (k.dot(&powers(r)) - bend(r)).abs()).fold(0.0, f64::max);
    let error_px = fx.max(fy) * off;
    error_px.is_finite().then_some(([k[0], k[1], k[2]], error_px))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(model: &str, distortion: &[f64]) -> CameraInfo {
        let intrinsics = [504.6, 504.6, 319.5, 287.5];
        let (size, distortion) = ((640, 576), distortion.to_vec());
        CameraInfo { size, model: model.into(), distortion, intrinsics, rectified: intrinsics }
    }

    #[test]
    fn a_rational_lens_becomes_the_nearest_of_five_coefficients() {
        // Similar to an Azure Kinect's narrow field of view.
        let d = [4.0437, 2.5939, 1e-5, -2e-5, 0.1287, 4.3788, 3.9073, 0.6963];
        let (k, said) = lens(&info(RATIONAL, &d)).unwrap();
        let [k1, k2, p1, p2, k3] = k.unwrap();
        // numpy.linalg.lstsq on the same rings.
        for (k, expected) in [(k1, -0.3268), (k2, 0.1358), (k3, -0.0309)] {
            assert!((k - expected).abs() < 2e-3, "{k}, not {expected}");
        }
        assert_eq!((p1, p2), (1e-5, -2e-5));
        assert!(said.unwrap().contains("0.2"), "px");
    }

    #[test]
    fn lenses_that_five_coefficients_cannot_say_are_refused() {
        let none = lens(&info("plumb_bob", &[0.0; 5])).unwrap();
        assert_eq!(none, (None, None));
        let five = [0.1, -0.2, 0.0, 0.0, 0.05, 0.0, 0.0, 0.0];
        assert_eq!(
            lens(&info(RATIONAL, &five)).unwrap(),
            (Some([0.1, -0.2, 0.0, 0.0, 0.05]), None)
        );
        assert!(lens(&info("equidistant", &[0.1, 0.0, 0.0, 0.0])).is_err());
        // Similar to an Azure Kinect's colour camera, whose numerator and denominator nearly have poles.
        let colour = info(RATIONAL, &[0.4, -2.5, 0.0, 0.0, 1.46, 0.28, -2.3, 1.39]);
        let intrinsics = [612.0, 612.0, 639.5, 359.5];
        // 6 px off, by numpy.linalg.lstsq.
        assert!(lens(&CameraInfo { intrinsics, size: (1280, 720), ..colour }).is_err());
    }
}
