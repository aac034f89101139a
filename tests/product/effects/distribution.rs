//! Effects on the distribution of values.

use super::laboratory::{Laboratory, ROUNDING_M, close, mean, variance};

/// The distinct depths of a frame, sorted, m.
fn distinct(frame: &[f64]) -> Vec<f64> {
    let mut depths: Vec<f64> = frame.iter().copied().filter(|z| z.is_finite()).collect();
    depths.sort_by(f64::total_cmp);
    depths.dedup();
    depths
}

/// Gaps between occurring depths are step z^2 / (fx b): 1/8 px is 5.7 mm at 1 m with fx = 290 px.
#[test]
fn disparity_steps_leave_gaps_that_grow_with_z_squared() {
    let lab = Laboratory::wall(1.5, 50.0, 0.0).with("disparity-quantisation:step_px=0.125");
    let scale = lab.sensor.disparity_px_m().unwrap();
    let depths = distinct(&lab.frame());
    assert!(depths.len() > 40, "{}", depths.len());
    for pair in depths.windows(2) {
        let step = scale / pair[0] - scale / pair[1];
        let slack = 2.0 * ROUNDING_M * scale / (pair[0] * pair[0]);
        close(step, 0.125, slack, "gap in px");
    }
}

#[test]
fn rounded_depths_leave_the_same_gap_everywhere() {
    // Tilted so little that neighbouring pixels differ by less than a step.
    let lab = Laboratory::wall(1.5, 20.0, 0.0).with("depth-rounding:step_m=0.01");
    let depths = distinct(&lab.frame());
    assert!(depths.len() > 50, "{}", depths.len());
    for pair in depths.windows(2) {
        close(pair[1] - pair[0], 0.01, 2.0 * ROUNDING_M, "gap in m");
    }
}

/// Variance and tail of the mixture (1 - p) N(0, 1) + p N(0, s^2), independent of the code.
///
/// 76,800 pixels: the count beyond 4 sigma is Poisson with mean 651, tolerance 5.9 standard deviations; the
/// variance 1 + p (s^2 - 1) has a standard error below 0.8 %. False alarms below 1e-6.
#[test]
fn gross_mismatches_are_a_mixture() {
    let (sigma, share, scale) = (0.002, 0.02, 5.0);
    let lab =
        Laboratory::wall(1.5, 0.0, 0.0).noise(sigma).with("heavy-tails:fraction=0.02,scale=5");
    let errors: Vec<f64> = lab.depth_errors(&lab.frame()).iter().map(|e| e / sigma).collect();
    let expected = 1.0 + share * (scale * scale - 1.0);
    // The error is symmetric in 1/z but measured in z: skewed by 10 sigma / z = 1.5 %.
    close(variance(&errors) / expected, 1.0, 0.05, "variance");
    let beyond = errors.iter().filter(|e| e.abs() > 4.0).count() as f64;
    // P(|N| > 4/5) = 0.42371 (tables of the normal distribution).
    let count = share * 0.42371 * errors.len() as f64;
    close(beyond, count, 150.0, "pixels beyond 4 sigma");
}

/// Pixels outside the tails keep their values exactly.
#[test]
fn the_bulk_does_not_notice_the_tails() {
    let lab = Laboratory::wall(1.5, 0.0, 0.0).noise(0.002);
    let bare = lab.frame();
    let tailed = lab.with("heavy-tails:fraction=0.02,scale=5").frame();
    let same = bare.iter().zip(&tailed).map(|(a, b)| f64::from(u8::from(a == b)));
    // Binomial with mean 0.98 and a standard error of 0.05 %; a few new errors round to the old word.
    close(mean(&same.collect::<Vec<_>>()), 0.98, 0.004, "share of untouched pixels");
}
