//! Correlated noise: over the image, over frames, over views.
//!
//! A correlation over n independent pairs has a standard error of 1 / sqrt(n): 0.0036 over an image.
//! Tolerances are five standard errors, with fewer effective pairs where noise is correlated: false alarm
//! probability 6e-7 per comparison.

use super::laboratory::{
    Laboratory, close, column_and_row_means, correlation, difference, mean, sd, variance,
};

const SIGMA_M: f64 = 0.002;

fn wall(effect: &str) -> Laboratory {
    Laboratory::wall(1.5, 0.0, 0.0).noise(SIGMA_M).with(effect)
}

/// Correlation of a moving mean over 9 px: rho(k) = 1 - k/9 and zero from 9 px on, in both directions.
///
/// 76,800 / 81 = 948 windows per frame, 20 frames: standard error 0.8 %.
#[test]
fn neighbours_share_a_window() {
    let lab = wall("spatial-correlation:length_px=9");
    let frames = lab.view(0, 20);
    // Differences of frames: frozen noise cannot mimic a window.
    let moving: Vec<Vec<f64>> =
        frames.chunks(2).map(|pair| difference(&pair[0], &pair[1])).collect();
    for (k, stride) in [1, 3, 6, 9, 14].into_iter().flat_map(|k| [(k, 1), (k, lab.width())]) {
        let lag = k * stride;
        let fits = |i: &usize| stride > 1 || i % 320 + k < 320;
        let rho = moving.iter().map(|d| {
            let pairs: Vec<usize> = (0..d.len() - lag).filter(fits).collect();
            let a: Vec<f64> = pairs.iter().map(|&i| d[i]).collect();
            let b: Vec<f64> = pairs.iter().map(|&i| d[i + lag]).collect();
            correlation(&a, &b)
        });
        let rho = mean(&rho.collect::<Vec<_>>());
        close(rho, (1.0 - k as f64 / 9.0).max(0.0), 0.05, &format!("rho at {k} px"));
    }
    let all: Vec<f64> = frames.iter().flat_map(|f| lab.depth_errors(f)).collect();
    close(sd(&all) / SIGMA_M, 1.0, 0.03, "the size of the noise stays");
}

/// First order: rho(2) = rho(1)^2, rho(3) = rho(1)^3; the standard deviation stays the same.
#[test]
fn a_filter_over_time_is_an_autoregression() {
    let lab = wall("temporal-correlation:rho=0.6");
    let frames = lab.view(0, 12);
    let rho = |lag: usize| {
        let pairs = frames.iter().zip(&frames[lag..]);
        mean(&pairs.map(|(a, b)| correlation(a, b)).collect::<Vec<_>>())
    };
    for lag in 1..=4 {
        close(rho(lag), 0.6f64.powi(lag as i32), 0.01, "correlation over frames");
    }
    for frame in [&frames[0], &frames[11]] {
        close(sd(frame) / SIGMA_M, 1.0, 0.013, "size");
    }
    let next = lab.view(1, 1).remove(0);
    close(correlation(&frames[11], &next), 0.0, 0.018, "a new view begins afresh");
}

/// Half the variance of a frame difference is the temporal part.
#[test]
fn speckle_stands_still_within_a_view() {
    let lab = wall("frozen-noise:fraction=0.8");
    let frames = lab.view(0, 2);
    let moving = 0.5 * variance(&difference(&frames[0], &frames[1]));
    close(1.0 - moving / variance(&frames[0]), 0.8, 0.01, "frozen share");
    close(sd(&frames[0]) / SIGMA_M, 1.0, 0.013, "size");
    let far = lab.view(0, 12);
    close(correlation(&far[0], &far[11]), 0.8, 0.01, "it never decays");
    let other = lab.view(1, 1).remove(0);
    close(correlation(&frames[0], &other), 0.0, 0.018, "another view, another grain");
}

/// Means of 240 rows: standard deviation known to 4.6 %, over 10 frames to 1.4 %.
#[test]
fn a_row_moves_as_one() {
    let lab = wall("row-noise:sigma_px=0.05");
    let noise_px = SIGMA_M * 21.75 / (1.5 * 1.5);
    let (mut rows, mut columns) = (Vec::new(), Vec::new());
    for frame in lab.view(0, 10) {
        let means = column_and_row_means(&lab.disparity_errors(&frame), lab.width());
        columns.push(means.0);
        rows.push(means.1);
    }
    let all: Vec<f64> = rows.concat();
    let expected = (0.05f64.powi(2) + noise_px * noise_px / 320.0).sqrt();
    close(sd(&all) / expected, 1.0, 0.075, "sd of the rows");
    // Columns average the shifts of 240 rows, common to all: only their own noise differs.
    close(sd(&columns[0]) / (noise_px / 240f64.sqrt()), 1.0, 0.2, "sd of the columns");
    close(correlation(&rows[0], &rows[1]), 0.0, 0.33, "afresh in each frame");
}

/// Means of 300 frames: standard deviation known to 4.1 %.
#[test]
fn a_frame_moves_as_one() {
    let lab = Laboratory::wall(1.5, 0.0, 0.0).with("frame-jitter:sigma_px=0.05");
    let frames = lab.view(0, 300);
    let errors: Vec<Vec<f64>> = frames.iter().map(|f| lab.disparity_errors(f)).collect();
    let means: Vec<f64> = errors.iter().map(|e| mean(e)).collect();
    close(sd(&means) / 0.05, 1.0, 0.21, "sd of the frames");
    assert!(sd(&errors[0]) < 0.001, "within a frame nothing moves");
    close(correlation(&means[1..], &means[..299]), 0.0, 0.29, "afresh in each frame");
}
