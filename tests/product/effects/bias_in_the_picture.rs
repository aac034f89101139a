//! Biases fixed to the image or to the board.

use std::f64::consts::TAU;

use kinoise::scene::{Board, Target, TargetFrame};
use nalgebra::Vector3;

use super::laboratory::{
    Laboratory, ROUNDING_M, close, column_and_row_means, correlation, line, mean, sd, variance,
};

/// Sine and cosine coefficients of `y` at this frequency (cycles per unit of `x`): Lomb's periodogram, for
/// samples dense enough to be orthogonal.
fn wave(x: &[f64], y: &[f64], frequency: f64) -> (f64, f64) {
    let middle = mean(y);
    let part = |f: fn(f64) -> f64| {
        let sum: f64 = x.iter().zip(y).map(|(x, y)| (y - middle) * f(TAU * frequency * x)).sum();
        2.0 * sum / x.len() as f64
    };
    (part(f64::sin), part(f64::cos))
}

/// The strongest wave has one cycle per pixel and 0.1 px amplitude, and pulls towards whole pixels.
///
/// Noise of 0.02 to 0.06 px on 76,800 pixels: standard error of the amplitude 3e-4 px; the tolerance is 20
/// of them, false alarms below 1e-9.
#[test]
fn pixel_locking_is_one_wave_a_pixel() {
    let lab = Laboratory::wall(1.0, 55.0, 0.0).noise(0.001).with("pixel-locking:amplitude_px=0.1");
    let scale = lab.sensor.disparity_px_m().unwrap();
    let pairs = lab.disparity_errors(&lab.frame()).into_iter().zip(lab.truth());
    // The far side is out of range.
    let pairs = pairs.filter(|(error, _)| error.is_finite());
    let (errors, disparity): (Vec<f64>, Vec<f64>) = pairs.map(|(e, z)| (e, scale / z)).unzip();
    let power = |k: i32| {
        let (s, c) = wave(&disparity, &errors, f64::from(k) * 0.02);
        s.hypot(c)
    };
    let best = (10..=300).max_by(|&a, &b| power(a).total_cmp(&power(b))).unwrap();
    close(f64::from(best) * 0.02, 1.0, 0.021, "cycles per px");
    let (sine, cosine) = wave(&disparity, &errors, 1.0);
    close(sine, -0.1, 0.006, "the sine: above a whole pixel the answer is too small");
    close(cosine, 0.0, 0.006, "the cosine");
}

/// Column means show a sawtooth of 8 teeth; row means show nothing.
#[test]
fn banding_is_vertical_and_periodic() {
    let lab =
        Laboratory::wall(1.0, 0.0, 0.0).with("column-banding:amplitude_px=0.0625,period_px=40");
    let errors = lab.disparity_errors(&lab.frame());
    let (columns, rows) = column_and_row_means(&errors, lab.width());
    assert!(sd(&rows) < 1e-4, "rows: {}", sd(&rows));
    let place: Vec<f64> = (0..columns.len()).map(|u| u as f64).collect();
    let strongest = (1..80).map(|teeth| {
        let (s, c) = wave(&place, &columns, f64::from(teeth) / 320.0);
        (s.hypot(c), teeth)
    });
    let (height, teeth) = strongest.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    assert_eq!(teeth, 8);
    // Fourier: the first harmonic of a sawtooth between -a and a is 2 a / pi.
    close(height, 2.0 * 0.0625 / std::f64::consts::PI, 0.002, "first harmonic, px");
    let jumps = columns.windows(2).filter(|w| (w[1] - w[0]).abs() > 0.06).count();
    assert_eq!(jumps, 8, "edges of a whole step");
}

/// In px the bowl is the same at 1.5 and 3 m, so in m it grows with z^2.
#[test]
fn the_bowl_is_k_at_the_corner_whatever_the_distance() {
    for z in [1.5, 3.0] {
        let lab = Laboratory::wall(z, 0.0, 0.0).with("radial-disparity-bias:k_px=0.5");
        let errors = lab.disparity_errors(&lab.frame());
        let corner = 159.5f64.powi(2) + 119.5f64.powi(2);
        let square = |i| {
            let (du, dv) = lab.off_centre(i);
            (du * du + dv * dv) / corner
        };
        let squares: Vec<f64> = (0..errors.len()).map(square).collect();
        let (slope, offset) = line(&squares, &errors);
        close(slope, 0.5, 0.001, "px at the corner");
        close(offset, 0.0, 0.001, "px in the middle");
        assert!(correlation(&squares, &errors) > 0.9999);
    }
}

/// Column, from the principal point, of the extremum of the error along the middle row.
fn turning_column(lab: &Laboratory, errors: &[f64]) -> f64 {
    let row = 120 * lab.width();
    let points = (row..row + lab.width()).filter(|&i| errors[i].is_finite());
    let points: Vec<(f64, f64)> = points.map(|i| (lab.off_centre(i).0, errors[i])).collect();
    let (n, middle) = (points.len(), points[points.len() / 2].0);
    let third = |k: usize| {
        let part = &points[k * n / 3..(k + 1) * n / 3];
        line(
            &part.iter().map(|p| p.0).collect::<Vec<_>>(),
            &part.iter().map(|p| p.1).collect::<Vec<_>>(),
        )
        .0
    };
    // The slope of a parabola is linear: it is zero where the line through the outer thirds' slopes is.
    let reach = n as f64 / 3.0;
    middle - reach * (third(2) + third(0)) / (third(2) - third(0))
}

/// When the board moves 0.1 m sideways, the bowl's extremum stays in the image, the bow's moves with the
/// board by 290 px / 1.5 m * 0.1 m = 19.3 px.
#[test]
fn the_bowl_stays_in_the_picture_and_the_bow_on_the_board() {
    for (effect, moves) in
        [("radial-disparity-bias:k_px=1", 0.0), ("target-bow:sagitta_m=0.02", 19.33)]
    {
        let mut lab = Laboratory::wall(1.5, 0.0, 0.0).with(effect);
        for aside in [0.0, 0.1] {
            let centre = Vector3::new(aside, 0.0, 1.5);
            lab.bench.target = Target::Board(Board { width_m: 1.0, height_m: 0.8 });
            lab.bench.frame = TargetFrame::on(&lab.bench.plane, centre);
            let turning = turning_column(&lab, &lab.depth_errors(&lab.frame()));
            close(turning, moves * aside / 0.1, 1.0, effect);
        }
    }
}

/// The bow by formula agrees with rays cast on a bent surface.
#[test]
fn the_bow_is_that_of_a_bent_board() {
    for azimuth in [0.0, 70.0] {
        let mut lab = Laboratory::wall(1.5, 35.0, azimuth);
        lab.bench.target = Target::Board(Board { width_m: 1.0, height_m: 0.8 });
        let formula = lab.clone().with("target-bow:sagitta_m=0.004,span_m=1").frame();
        let flat = lab.frame();
        lab.bench.sagitta_m = 0.004;
        let cast = lab.frame();
        let mut most: f64 = 0.0;
        for ((a, b), flat) in formula.iter().zip(&cast).zip(&flat) {
            if a.is_finite() && b.is_finite() {
                close(*a, *b, 2.0 * ROUNDING_M + 4e-5, "depth of a bowed board");
                most = most.max(flat - b);
            }
        }
        assert!(most > 0.0035, "the bow is there to be compared: {most}");
    }
}

/// The pattern in px is the same at two distances and in another view; its size.
///
/// Standard error of a standard deviation over 76,800 pixels: 0.26 %; tolerance 5 of them, false alarms 6e-7.
#[test]
fn the_fixed_pattern_is_the_units_own() {
    let pattern = |z: f64, view| {
        let lab = Laboratory::wall(z, 0.0, 0.0).with("fixed-pattern-noise:sigma_px=0.05");
        lab.disparity_errors(&lab.view(view, 1)[0])
    };
    let (near, far) = (pattern(1.0, 0), pattern(2.0, 7));
    assert!(correlation(&near, &far) > 0.99);
    close(variance(&near).sqrt() / 0.05, 1.0, 0.013, "sd");
    close(correlation(&near[1..], &near[..near.len() - 1]), 0.0, 0.018, "neighbours");
}
