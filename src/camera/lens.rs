//! The Brown-Conrady lens model: where it bends a ray, and which ray it bent.

/// The map contracts by the size of the distortion: a tenth a round for a Kinect, which settles in
/// ten; at four fifths a round, where a lens model is about to fold, it takes this many.
const MAX_ROUNDS: usize = 100;
/// Last change of the normalised coordinates: 1e-7 px at 1000 px of focal length, and below what
/// single-precision rays resolve.
const SETTLED: f64 = 1e-10;

/// The ray (x, y, 1) that the lens bends to (xd, yd, 1).
pub(super) fn undistorted(k: &[f64; 5], xd: f64, yd: f64) -> Option<(f64, f64)> {
    let (mut x, mut y) = (xd, yd);
    for _ in 0..MAX_ROUNDS {
        let (dx, dy, radial) = lens(k, x, y);
        let (next_x, next_y) = ((xd - dx) / radial, (yd - dy) / radial);
        let change = (next_x - x).abs().max((next_y - y).abs());
        (x, y) = (next_x, next_y);
        if change < SETTLED {
            // A negative factor would be a ray from the far side of the axis.
            return (radial > 0.0).then_some((x, y));
        }
    }
    None
}

/// Does the bent radius r (1 + k1 s + k2 s^2 + k3 s^3), s = r^2, fall anywhere up to s = `farthest`?
/// Its slope is 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3, least at the end or where its own slope is zero.
pub(super) fn folds(k: &[f64; 5], farthest: f64) -> bool {
    let [k1, k2, _, _, k3] = *k;
    let slope = |s: f64| 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * 7.0 * k3));
    let (a, b, c) = (21.0 * k3, 10.0 * k2, 3.0 * k1);
    let root = (b * b - 4.0 * a * c).sqrt();
    // Both roots in the form that does not cancel; NaN and infinity fall outside the range.
    let q = -0.5 * (b + b.signum() * root);
    let mut places = [farthest, q / a, c / q].into_iter().filter(|s| (0.0..=farthest).contains(s));
    places.any(|s| slope(s) <= 0.0)
}

/// Tangential shift and radial factor of the Brown-Conrady model at the undistorted (x, y).
pub(super) fn lens(k: &[f64; 5], x: f64, y: f64) -> (f64, f64, f64) {
    let [k1, k2, p1, p2, k3] = *k;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    let dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    (dx, dy, radial)
}

#[cfg(test)]
mod tests {
    use super::folds;
    use crate::camera::{Camera, CameraFault};

    fn behind(distortion: [f64; 5]) -> Camera {
        Camera { distortion: Some(distortion), ..Camera::centred(640, 480, 580.0) }
    }

    #[test]
    fn a_usable_lens_gives_back_every_pixel() {
        for k in [[0.0; 5], [-0.26, 0.1, -7.6e-4, 5.0e-3, 0.02], [-0.35, 0.15, 0.0, 0.0, 0.0]] {
            let camera = behind(k);
            assert_eq!(camera.fault(), None, "{k:?}");
            for (u, v) in (0..640).step_by(71).zip((0..480).step_by(53)) {
                let (x, y) = camera.ray(u as f64, v as f64);
                let (pu, pv) = camera.project(x, y);
                assert!((pu - u as f64).hypot(pv - v as f64) < 1e-6, "{k:?}: {pu} {pv}");
            }
        }
    }

    /// A barrel whose bent radius r (1 - 0.8 r^2) never reaches the corners (0.69): it ends at
    /// r = 1/sqrt(2.4) with 0.43.
    #[test]
    fn a_lens_that_does_not_reach_the_corners_is_named() {
        let camera = behind([-0.8, 0.0, 0.0, 0.0, 0.0]);
        let fault = camera.fault().expect("no ray");
        assert!(matches!(fault, CameraFault::NoRay { u: 0, v: 0, .. }), "{fault:?}");
        assert!(fault.to_string().contains("[-0.8, 0, 0, 0, 0]"), "{fault}");
        assert!(camera.ray(0.0, 0.0).0.is_nan() && camera.ray(320.0, 240.0).0.is_finite());
    }

    /// The slope 1 - 7.5 s + 12.5 s^2 is negative between s = 0.2 and 0.4, inside the image.
    #[test]
    fn a_lens_that_folds_is_named() {
        let fault = behind([-2.5, 2.5, 0.0, 0.0, 0.0]).fault().expect("a fault");
        assert!(fault.to_string().contains("[-2.5, 2.5, 0, 0, 0]"), "{fault}");
        assert!(folds(&[-2.5, 2.5, 0.0, 0.0, 0.0], 0.5), "k3 = 0");
        assert!(folds(&[-1.0, 0.0, 0.0, 0.0, 0.0], 0.5), "k2 = k3 = 0");
        assert!(folds(&[0.0, 0.0, 0.0, 0.0, -1.0], 1.0), "k1 = k2 = 0");
        assert!(!folds(&[-2.5, 2.5, 0.0, 0.0, 0.0], 0.1) && !folds(&[0.0; 5], 1.0));
    }
}
