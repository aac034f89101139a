//! Hand-made diagnoses of every kind.

use serde_json::{Map, Value, json};

use super::super::Picture;
use crate::diagnose::*;
use crate::terms::{Axis, Statistic};

fn map(value: Value) -> Map<String, Value> {
    value.as_object().cloned().unwrap()
}

fn curve(x_label: &str, end: f64, shape: impl Fn(f64) -> f64) -> Option<Curve> {
    let x: Vec<f64> = (0..16).map(|i| end * f64::from(i) / 15.0).collect();
    let model: Vec<f64> = x.iter().map(|x| shape(*x)).collect();
    let y = model.iter().enumerate().map(|(i, y)| y + 0.01 * (i * 7 % 5) as f64).collect();
    let [x_label, y_label] = [x_label, "error of disparity (px)"].map(String::from);
    Some(Curve { x_label, y_label, x, y, y_std_error: vec![0.01; 16], model })
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
        physics: "a bent board would move with the board & not stay in the picture".into(),
        curve: curve("radius (px)", 398.0, |r| 0.31 * (r / 398.0).powi(2) - 0.1),
        ..finding(Status::Named, Some("radial-disparity-bias"))
    }
}

fn noise() -> Finding {
    Finding {
        statistic: Statistic::Variance,
        axis: Axis::Z,
        interval: [1.62, 3.4],
        unit: "m",
        share: 0.21,
        p_adjusted: 1e-9,
        ..finding(Status::Named, Some("range-exponent"))
    }
}

fn one_of() -> Finding {
    Finding {
        alternatives: alternatives(&[("radial-disparity-bias", 0.57), ("target-bow", 0.38)]),
        next_view: Some(NextView {
            z_m: 0.8,
            theta_rad: 0.785,
            azimuth_rad: 0.05,
            separation_now: 0.4,
            separation_then: 6.0,
            why: "a bent board moves with the board".into(),
        }),
        ..finding(Status::OneOf, Some("radial-disparity-bias"))
    }
}

fn unexplained() -> Finding {
    Finding {
        axis: Axis::Row,
        interval: [301.0, 332.0],
        shape: Some("a step at row 317, −0.08 px above and +0.08 px below".into()),
        share: 0.12,
        curve: curve("row (px)", 479.0, |v| if v < 317.0 { -0.08 } else { 0.08 }),
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
            correction_rms_before_px: 0.214,
            correction_rms_after_px: 0.190,
        })
        .filter(|_| !nothing),
        after: After { verdict: Verdict::Match, remaining: Vec::new() },
        detectable: vec![
            Detectable { effect: "radial-disparity-bias", minimum: map(json!({"k_px": 0.021})) },
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
    let (width, height) = (16, 12);
    let pixels = |bowl: f32| -> Vec<f32> {
        (0..width * height).map(|i| if i % 16 == 0 { f32::NAN } else { bowl * i as f32 }).collect()
    };
    let caption = "view-08: 3.00 m, facing <the> sensor".into();
    let [before, after, twin] = [2e-3, 0.0, 1.9e-3].map(pixels);
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
