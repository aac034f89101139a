//! Hand-made diagnoses of every kind.

use serde_json::{Map, Value, json};

use super::super::Picture;
use crate::diagnose::*;
use crate::terms::{Axis, Statistic};

fn map(value: Value) -> Map<String, Value> {
    value.as_object().cloned().unwrap()
}

fn curve(x: [f64; 2], labels: [&str; 2], shape: impl Fn(f64) -> f64) -> Option<Curve> {
    let at = |i: usize| x[0] + (x[1] - x[0]) * i as f64 / 15.0;
    let wobble = |i: usize| 0.06 * ((i * 7 % 5) as f64 - 2.0);
    let height = (0..16).map(|i| shape(at(i)).abs()).fold(0.0, f64::max);
    Some(Curve {
        x_label: labels[0].into(),
        y_label: labels[1].into(),
        x: (0..16).map(at).collect(),
        y: (0..16).map(|i| shape(at(i)) + wobble(i) * height).collect(),
        y_std_error: (0..16).map(|i| height * (0.04 + 0.01 * (i % 4) as f64)).collect(),
        model: (0..16).map(|i| shape(at(i))).collect(),
    })
}

pub(super) fn finding(status: Status, effect: Option<&'static str>) -> Finding {
    Finding {
        status,
        effect,
        alternatives: Vec::new(),
        statistic: Statistic::Bias,
        axis: Axis::Radius,
        interval: [118.0, 398.0],
        unit: "px",
        share: 0.63,
        parameters: Map::new(),
        size: Size { mm: 1.84, sigma: 0.42 },
        p_adjusted: 0.0004,
        physics: String::new(),
        next_view: None,
        shape: None,
        curve: None,
        terms: Vec::new(),
    }
}

fn alternatives(all: &[(&'static str, f64)]) -> Vec<Alternative> {
    all.iter().map(|&(effect, probability)| Alternative { effect, probability }).collect()
}

fn bowl() -> Finding {
    Finding {
        alternatives: alternatives(&[("radial-disparity-bias", 0.97), ("lens-distortion", 0.02)]),
        parameters: map(json!({"k_px": {"value": 0.3123, "std_error": 0.0121}})),
        physics: "lens and projector are off their calibration by a smooth bowl about the middle of the picture; in depth it grows with the square of the distance. A bent board would move with the board & not stay in the picture".into(),
        curve: curve([0.0, 398.0], ["distance from the middle (px)", "error of disparity (px)"], |r| {
            0.31 * (r / 398.0).powi(2) - 0.1
        }),
        ..finding(Status::Named, Some("radial-disparity-bias"))
    }
}

fn noise() -> Finding {
    Finding {
        alternatives: alternatives(&[("range-exponent", 0.91)]),
        statistic: Statistic::Variance,
        axis: Axis::Z,
        interval: [1.62, 3.4],
        unit: "m",
        share: 0.21,
        parameters: map(json!({"excess": {"value": 0.31, "std_error": 0.04}})),
        size: Size { mm: 0.61, sigma: 0.18 },
        p_adjusted: 1e-9,
        curve: curve([0.6, 3.4], ["distance (m)", "noise over the simulated noise"], |z| {
            (z / 2.0).powf(0.31)
        }),
        ..finding(Status::Named, Some("range-exponent"))
    }
}

fn one_of() -> Finding {
    Finding {
        alternatives: alternatives(&[
            ("radial-disparity-bias", 0.55),
            ("target-bow", 0.38),
            ("range-not-depth", 0.02),
        ]),
        next_view: Some(NextView {
            z_m: 0.8,
            theta_rad: 0.785,
            azimuth_rad: 0.05,
            separation_now: 0.4,
            separation_then: 6.0,
            why: "a bent board moves with the board, a bowl of the lens stays in the picture"
                .into(),
        }),
        curve: bowl().curve,
        ..finding(Status::OneOf, Some("radial-disparity-bias"))
    }
}

fn unexplained() -> Finding {
    Finding {
        axis: Axis::Row,
        interval: [301.0, 332.0],
        shape: Some("a step at row 317, −0.08 px above and +0.08 px below".into()),
        share: 0.12,
        curve: curve([0.0, 479.0], ["row (px)", "error of disparity (px)"], |v| {
            if v < 317.0 { -0.08 } else { 0.08 }
        }),
        ..finding(Status::Unexplained, None)
    }
}

pub(super) fn diagnosis(verdict: Verdict, findings: Vec<Finding>) -> Diagnosis {
    let nothing = findings.is_empty();
    let view = |i: usize| ViewLine {
        name: format!("view-{i:02}"),
        z_m: 0.6 + 0.3 * i as f64,
        theta_rad: 0.2 * (i % 4) as f64,
        azimuth_rad: 1.5,
        frames: 30,
        pixels: 48_211,
        bowl_px_before: 0.121,
        bowl_px_after: 0.018,
        held_out: i.is_multiple_of(4),
    };
    Diagnosis {
        format: DIAGNOSIS_FORMAT,
        recording: "office <b> & co".into(),
        reference: Reference::Model,
        verdict,
        findings,
        map: (0..if nothing { 0 } else { 15 }).map(row).collect(),
        left_out: None,
        heldout: Some(HeldOut {
            views: vec!["view-00".into(), "view-04".into(), "view-08".into()],
            log_score_before: -4213.2,
            log_score_after: -4170.9,
            gain: 42.31,
            gain_interval: [31.2, 55.0],
            rms_mm_before: 3.12,
            rms_mm_after: 1.17,
            rms_px_before: 0.214,
            rms_px_after: 0.181,
        })
        .filter(|_| !nothing),
        after: After { verdict: Verdict::Match, remaining: Vec::new() },
        detectable: vec![
            Detectable { effect: "radial-disparity-bias", minimum: map(json!({"k_px": 0.021})) },
            Detectable { effect: "pixel-locking", minimum: map(json!({"amplitude_px": 0.011})) },
            Detectable {
                effect: "target-bow",
                minimum: map(json!({"sagitta_m": 0.00062, "span_m": 1.0})),
            },
        ],
        cannot_tell: vec![CannotTell {
            effect: "depth-scale",
            why: "a flat board stays flat under it; measured distances would show it".into(),
        }],
        views: (0..12).map(view).collect(),
        remarks: vec!["view <i>: one frame is missing".into()],
    }
}

fn row(i: usize) -> MapRow {
    MapRow {
        statistic: [Statistic::Bias, Statistic::Variance, Statistic::Dropout][i % 3],
        axis: [Axis::Radius, Axis::Z, Axis::Theta][i % 3],
        interval: [[118.0, 398.0], [1.62, 3.4], [0.7, 1.1]][i % 3],
        unit: ["px", "m", "rad"][i % 3],
        effect_size: 0.42 / (1.0 + i as f64),
        p_adjusted: 1e-4 * (1.0 + i as f64).powi(2),
    }
}

pub(super) fn picture() -> Picture {
    let (width, height) = (160, 120);
    let noise = |i: usize| ((i * 7919 % 1013) as f32 / 1013.0 - 0.5) * 0.25;
    let pixels = |bowl: f32| -> Vec<f32> {
        let value = |i: usize| {
            let [x, y] = [(i % width) as f32 / 80.0 - 1.0, (i / width) as f32 / 60.0 - 1.0];
            if x.abs() > 0.9 { f32::NAN } else { bowl * (x * x + y * y - 0.6) + noise(i) }
        };
        (0..width * height).map(value).collect()
    };
    let caption = "view-08: 3.00 m, facing <the> sensor".into();
    let [before, after, twin] = [0.4, 0.0, 0.38].map(pixels);
    Picture { caption, width, height, before, after, simulated: Some(twin), unit: "px", range: 0.5 }
}

/// A diagnosis of every kind, by name.
pub(super) fn cases() -> Vec<(&'static str, Diagnosis)> {
    use Verdict::{Inconclusive, Match, Mismatch};
    let mut left = diagnosis(Mismatch, vec![bowl(), noise(), unexplained()]);
    left.after = After {
        verdict: Mismatch,
        remaining: vec![Remaining {
            statistic: Statistic::Distribution,
            axis: Axis::Residual,
            p_adjusted: 0.012,
            words: "a few more large errors than simulated".into(),
        }],
    };
    let tape = Finding {
        axis: Axis::Z,
        interval: [0.6, 3.9],
        unit: "m",
        ..finding(Status::NotIdentifiable, Some("depth-scale"))
    };
    let mut unsettled = diagnosis(Inconclusive, vec![]);
    unsettled.remarks.push("4 views are too few to set any aside".into());
    vec![
        ("named", diagnosis(Mismatch, vec![bowl()])),
        ("several", left),
        ("one-of", diagnosis(Mismatch, vec![one_of()])),
        ("unexplained", diagnosis(Mismatch, vec![unexplained()])),
        ("recalibrate", diagnosis(Mismatch, vec![finding(Status::Recalibrate, None)])),
        ("not-identifiable", diagnosis(Inconclusive, vec![tape])),
        ("match", diagnosis(Match, vec![])),
        ("inconclusive", unsettled),
    ]
}
