//! Lost pixels.

use super::laboratory::{Laboratory, close, line};

/// Share of pixels lost.
fn lost(lab: &Laboratory) -> f64 {
    let frame = lab.frame();
    frame.iter().filter(|z| z.is_nan()).count() as f64 / frame.len() as f64
}

/// Midpoint and width of the logistic through the shares lost at these places.
///
/// A share p of 76,800 pixels gives its log-odds a standard error of 1 / sqrt(n p (1 - p)), at most
/// 0.012 where p is between 0.1 and 0.9.
fn logistic_fit(places: &[f64], shares: &[f64]) -> (f64, f64) {
    let log_odds: Vec<f64> = shares.iter().map(|p| (p / (1.0 - p)).ln()).collect();
    let (slope, start) = line(places, &log_odds);
    (-start / slope, 1.0 / slope)
}

/// Share of the valid pixels, of a wall tilted about the horizontal, that the effect removes.
fn lost_when_tilted(theta: f64, effect: &str) -> f64 {
    let lab = Laboratory::wall(1.5, theta, 90.0);
    let there = lab.frame().iter().filter(|z| z.is_finite()).count() as f64;
    let left = lab.with(effect).frame().iter().filter(|z| z.is_finite()).count() as f64;
    1.0 - left / there
}

/// Half of a steep wall is out of range or behind the camera: 30,000 pixels remain, the fit has a standard
/// error of 0.02 degrees; tolerance 5 of them, false alarms 1e-6.
#[test]
fn grazing_angles_are_lost_by_a_logistic() {
    let effect = "grazing-dropout:theta50_deg=70,width_deg=2";
    let angles = [66.5, 68.0, 69.0, 70.0, 71.0, 72.0, 73.5];
    let shares = angles.map(|theta| lost_when_tilted(theta, effect));
    let (half, width) = logistic_fit(&angles, &shares);
    close(half, 70.0, 0.1, "angle of one half");
    close(width, 2.0, 0.1, "width");
    assert!(lost_when_tilted(30.0, effect) < 1e-3);
    let partly = lost_when_tilted(84.0, "grazing-dropout:share=0.4,theta50_deg=70,width_deg=1");
    close(partly, 0.4, 0.05, "a share beyond the angle");
}

/// Standard error of the fit 0.4 mm; tolerance over 5 of them, false alarms 1e-6.
#[test]
fn the_far_and_the_near_end_are_lost_by_a_logistic() {
    for (effect, sign) in [("z50_m=3,width_m=0.1", 1.0), ("z50_m=3,width_m=-0.1", -1.0)] {
        let effect = format!("range-dropout:{effect}");
        let places = [2.8, 2.9, 2.95, 3.0, 3.05, 3.1, 3.2];
        let shares = places.map(|z| lost(&Laboratory::wall(z, 0.0, 0.0).with(&effect)));
        let (half, width) = logistic_fit(&places, &shares);
        close(half, 3.0, 0.003, "depth of one half");
        close(width, sign * 0.1, 0.003, "width");
    }
}

/// With zero width the cut-off is sharp.
#[test]
fn a_clip_is_a_clip() {
    let effect = "range-dropout:z50_m=3,width_m=0";
    assert_eq!(lost(&Laboratory::wall(2.99, 0.0, 0.0).with(effect)), 0.0);
    assert_eq!(lost(&Laboratory::wall(3.01, 0.0, 0.0).with(effect)), 1.0);
}
