//! Biases of the depth itself: rays, scales, offsets, time.

use kinoise::Plane;
use kinoise::effects::Instant;

use super::laboratory::{Laboratory, ROUNDING_M, close, instant, line, mean};

/// Compared with a camera that uses the library's lens model, not the effect's.
#[test]
fn distortion_moves_the_ray() {
    let k1 = -0.08;
    let lab = Laboratory::wall(1.5, 50.0, 30.0).with("lens-distortion:k1=-0.08");
    let mut lens = lab.sensor.camera.clone();
    lens.distortion = Some([k1, 0.0, 0.0, 0.0, 0.0]);
    let (mut most, straight) = (0f64, lab.truth());
    for (i, z) in lab.frame().iter().enumerate().filter(|(_, z)| z.is_finite()) {
        let (x, y) = lens.ray((i % lens.width) as f64, (i / lens.width) as f64);
        let true_depth = lab.bench.plane.depth(x, y);
        close(*z, true_depth, ROUNDING_M + 1e-5, "depth along the bent ray");
        most = most.max((true_depth - straight[i]).abs());
    }
    assert!(most > 0.01, "there is something to see: {most}");
}

#[test]
fn distortion_does_not_show_on_a_frontal_plane() {
    let lab = Laboratory::wall(1.5, 0.0, 0.0);
    assert_eq!(lab.frame(), lab.clone().with("lens-distortion:k1=-0.2").frame());
}

/// The range follows from the depth by Pythagoras.
#[test]
fn the_ray_is_longer_than_the_depth() {
    for theta in [0.0, 40.0] {
        let lab = Laboratory::wall(1.5, theta, 0.0).with("range-not-depth");
        let rays = lab.sensor.camera.rays();
        for (i, (z, truth)) in lab.frame().iter().zip(lab.truth()).enumerate() {
            let (x, y) = rays.at(i);
            let range = ((x * truth).powi(2) + (y * truth).powi(2) + truth * truth).sqrt();
            if z.is_finite() {
                close(*z, range, ROUNDING_M + 1e-6 * range, "range");
            }
        }
    }
}

/// (z, bias) at four distances, m.
fn biases(effect: &str) -> Vec<(f64, f64)> {
    let bias = |z: f64| {
        let lab = Laboratory::wall(z, 0.0, 0.0).with(effect);
        (z, mean(&lab.depth_errors(&lab.frame())))
    };
    [0.8, 1.5, 2.5, 3.5].map(bias).to_vec()
}

#[test]
fn a_wrong_scale_errs_with_z() {
    for (z, bias) in biases("depth-scale:scale=1.035") {
        close(bias / z, 0.035, 2.0 * ROUNDING_M, "bias over z");
    }
}

/// To first order in the offset the bias is -z^2 offset / (fx b), with fx b = 21.75 px m; exactly, 1/z - 1/z'
/// is constant.
#[test]
fn a_wrong_reference_errs_with_z_squared() {
    for (z, bias) in biases("disparity-offset:offset_px=0.1") {
        let constant = 1.0 / (z + bias) - 1.0 / z;
        close(constant, 0.1 / 21.75, 2.0 * ROUNDING_M / (z * z), "shift of 1/z");
    }
}

/// The remaining drift falls as exp(-t / tau): its logarithm is a line.
#[test]
fn warm_up_tends_to_its_limit() {
    let lab =
        Laboratory::wall(2.0, 0.0, 0.0).with("thermal-drift:relative=0.01,time_constant_s=600");
    let times: Vec<f64> = (0..20).map(|k| f64::from(k) * 60.0).collect();
    let when = |(k, &session_s): (usize, &f64)| Instant { session_s, ..instant(k, 0) };
    let instants: Vec<Instant> = times.iter().enumerate().map(when).collect();
    let left: Vec<f64> = lab
        .at(&instants)
        .iter()
        .map(|frame| (0.02 - mean(&lab.depth_errors(frame))).ln())
        .collect();
    let (slope, start) = line(&times, &left);
    close(-1.0 / slope, 600.0, 15.0, "time constant, s");
    close(start.exp(), 0.02, 2e-4, "the whole drift, m");
}

/// Each frame is compared with the plane shifted along the axis.
#[test]
fn a_moving_target_is_where_it_has_got_to() {
    let lab = Laboratory::wall(1.5, 40.0, 20.0).with("target-motion:velocity_mps=0.03");
    let rays = lab.sensor.camera.rays();
    for (k, frame) in lab.view(3, 30).iter().enumerate() {
        let gone = 0.03 * k as f64 / 30.0;
        let there = Plane::tilted(1.5 + gone, 40f64.to_radians(), 20f64.to_radians());
        for i in (0..frame.len()).step_by(97).filter(|&i| frame[i].is_finite()) {
            let (x, y) = rays.at(i);
            close(frame[i], there.depth(x, y), ROUNDING_M + 2e-6, "depth of the shifted plane");
        }
    }
}
