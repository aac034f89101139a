//! Metrics of one frame as in RealSense's Depth Quality Tool: a least-squares plane along the
//! best-conditioned axis, and the pixels' deviations from it.
//!
//! The formulas are from its readme (librealsense, tools/depth-quality/readme.md), the order of the steps
//! from its program (depth-metrics.h, rs-depth-quality.cpp). All in double precision; the tool uses single.

use nalgebra::Vector3;
use serde::Serialize;

/// What the tool shows for one frame. Shares are fractions, not percent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FrameMetrics {
    /// Share of the region's pixels that have a depth.
    pub fill_rate: f64,
    /// Distance of the camera from the fitted plane, m.
    pub distance_m: f64,
    /// Depth at which the optical axis meets the plane, m.
    pub axis_distance_m: f64,
    /// Angle between the optical axis and the plane's normal, rad.
    pub tilt_rad: f64,
    /// Root mean square of the pixels' distances from the plane, m: "spatial noise".
    pub plane_fit_rms_m: f64,
    /// RMS relative to the distance.
    pub plane_fit_rms: f64,
    /// RMS of the disparity errors, px; `None` without a baseline.
    pub subpixel_rms_px: Option<f64>,
    /// Median signed error against the reference distance, as a share of it.
    pub z_accuracy: Option<f64>,
}

/// The tool leaves out one in this many pixels at each end of the depths.
const LEFT_OUT: usize = 200;

/// A plane n . X + d = 0 with unit normal n.
struct Fit {
    n: Vector3<f64>,
    d: f64,
}

impl FrameMetrics {
    /// Metrics of the measured `points` (m) of a region of `pixels` pixels; `None` if they span no plane.
    pub fn of(
        mut points: Vec<Vector3<f64>>,
        pixels: usize,
        disparity_px_m: Option<f64>,
        reference_m: Option<f64>,
    ) -> Option<Self> {
        let fit = Fit::of(&points)?;
        let fill_rate = points.len() as f64 / pixels as f64;
        points.sort_by(|a, b| a.z.total_cmp(&b.z));
        let out = points.len() / LEFT_OUT;
        let kept = &points[out..points.len() - out];
        let offs: Vec<f64> = kept.iter().map(|p| fit.n.dot(p) + fit.d).collect();
        let rms = |squares: f64| (squares / kept.len() as f64).sqrt();
        let plane_fit_rms_m = rms(offs.iter().map(|off| off * off).sum());
        let (distance_m, axis_distance_m) = (fit.d.abs(), -fit.d / fit.n.z);
        // By depth, as in the tool's help; its code takes ranges, which a wide view shows as less.
        let error_px = |scale: f64| {
            let one = |(p, off): (&Vector3<f64>, &f64)| {
                (scale / p.z - scale / (p.z - off * fit.n.z)).powi(2)
            };
            rms(kept.iter().zip(&offs).map(one).sum())
        };
        let accuracy = |reference: f64| {
            let mut errors: Vec<f64> =
                offs.iter().map(|off| axis_distance_m - reference + off).collect();
            errors.sort_by(f64::total_cmp);
            errors[errors.len() / 2] / reference
        };
        Some(FrameMetrics {
            fill_rate,
            distance_m,
            axis_distance_m,
            tilt_rad: fit.n.z.abs().min(1.0).acos(),
            plane_fit_rms_m,
            plane_fit_rms: plane_fit_rms_m / distance_m,
            subpixel_rms_px: disparity_px_m.map(error_px),
            z_accuracy: reference_m.map(accuracy),
        })
    }

    /// Mean of each metric over the frames that have it; `None` for no frames.
    pub fn mean(frames: &[FrameMetrics]) -> Option<Self> {
        let count = frames.len() as f64;
        let of = |value: fn(&FrameMetrics) -> f64| frames.iter().map(value).sum::<f64>() / count;
        let maybe = |value: fn(&FrameMetrics) -> Option<f64>| {
            let all: Vec<f64> = frames.iter().filter_map(value).collect();
            (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
        };
        (!frames.is_empty()).then(|| FrameMetrics {
            fill_rate: of(|f| f.fill_rate),
            distance_m: of(|f| f.distance_m),
            axis_distance_m: of(|f| f.axis_distance_m),
            tilt_rad: of(|f| f.tilt_rad),
            plane_fit_rms_m: of(|f| f.plane_fit_rms_m),
            plane_fit_rms: of(|f| f.plane_fit_rms),
            subpixel_rms_px: maybe(|f| f.subpixel_rms_px),
            z_accuracy: maybe(|f| f.z_accuracy),
        })
    }
}

impl Fit {
    /// Least squares along the axis whose two others span the most.
    fn of(points: &[Vector3<f64>]) -> Option<Self> {
        if points.len() < 3 {
            return None;
        }
        let centroid = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = [0.0; 6];
        for p in points {
            let q = p - centroid;
            xx += q.x * q.x;
            xy += q.x * q.y;
            xz += q.x * q.z;
            yy += q.y * q.y;
            yz += q.y * q.z;
            zz += q.z * q.z;
        }
        let along = [yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy];
        let largest = along.into_iter().fold(0.0, f64::max);
        let [x, y, z] = along;
        let direction = if largest <= 0.0 {
            return None;
        } else if largest == x {
            Vector3::new(1.0, (xz * yz - xy * zz) / x, (xy * yz - xz * yy) / x)
        } else if largest == y {
            Vector3::new((yz * xz - xy * zz) / y, 1.0, (xy * xz - yz * xx) / y)
        } else {
            Vector3::new((yz * xy - xz * yy) / z, (xz * xy - yz * xx) / z, 1.0)
        };
        // Pointing away from the camera, so that points behind the plane have positive distances.
        let n = direction.normalize();
        let n = if n.dot(&centroid) < 0.0 { -n } else { n };
        Some(Fit { n, d: -n.dot(&centroid) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of points on z = 2 + 0.1 x, one lifted by four millimetres.
    #[test]
    fn a_plane_is_found_and_what_is_off_it() {
        let grid = (0..400).map(|k| (f64::from(k % 20) * 0.01, f64::from(k / 20) * 0.01));
        let mut points: Vec<_> = grid.map(|(x, y)| Vector3::new(x, y, 2.0 + 0.1 * x)).collect();
        let flat = FrameMetrics::of(points.clone(), 500, Some(43.5), Some(1.98)).unwrap();
        assert_eq!(flat.fill_rate, 0.8);
        assert!((flat.tilt_rad - 0.1f64.atan()).abs() < 1e-12 && flat.plane_fit_rms_m < 1e-12);
        assert!((flat.axis_distance_m - 2.0).abs() < 1e-12);
        assert!((flat.z_accuracy.unwrap() - 0.02 / 1.98).abs() < 1e-12);
        points[210].z += 0.004;
        let bumped = FrameMetrics::of(points, 500, None, None).unwrap();
        // One of the 396 kept points is off.
        let expected = 0.004 / 396f64.sqrt() / 1.01f64.sqrt();
        assert!((bumped.plane_fit_rms_m / expected - 1.0).abs() < 0.01);
        assert_eq!((bumped.subpixel_rms_px, bumped.z_accuracy), (None, None));
    }

    #[test]
    fn a_line_is_no_plane() {
        let line = (0..10).map(|k| Vector3::new(f64::from(k), 0.0, 1.0)).collect();
        assert_eq!(FrameMetrics::of(line, 10, None, None), None);
        assert_eq!(FrameMetrics::mean(&[]), None);
    }
}
