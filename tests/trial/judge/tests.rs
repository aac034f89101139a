//! Answers that are right throughout, answers to other questions, and single slips.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::{Judged, Marks, Scores, mark, scores};
use crate::raytraced::CATALOGUE;
use crate::raytraced::question::{Asked, Cell, Hidden, Truth, World};

fn truth(cell: Cell, names: &[&str], nats: f64) -> Truth {
    let hidden = |name: &&str| Hidden {
        names: if cell == Cell::Outside { Vec::new() } else { vec![name.to_string()] },
        form: name.to_string(),
        statistic: "bias".into(),
        axis: if cell == Cell::Outside { "row" } else { "radius" }.into(),
        also: Vec::new(),
        interval: Some([0.2, 0.6]),
        parameters: Map::from_iter([("k_px".into(), json!(0.5)), ("own".into(), json!(3.0))]),
        nats: None,
    };
    let asked = Asked {
        world: World::Rays,
        cell,
        names: Vec::new(),
        nats: Some(nats),
        seed: 1,
        small: true,
    };
    Truth { asked, hidden: names.iter().map(hidden).collect(), base: Value::Null }
}

fn finding(status: &str, name: Option<&str>, hidden: &Hidden) -> Value {
    let alternatives: Vec<Value> =
        name.iter().map(|n| json!({"effect": n, "probability": 1.0})).collect();
    json!({
        "status": status, "effect": name, "alternatives": alternatives,
        "statistic": hidden.statistic, "axis": hidden.axis, "interval": hidden.interval,
        "parameters": {"k_px": {"value": 0.5, "std_error": 0.01}}, "next_view": null,
    })
}

/// What an oracle would write.
fn perfect(truth: &Truth) -> Value {
    let one = |h: &Hidden| match (truth.asked.cell, h.names.first()) {
        (Cell::Blind, name) => finding("not-identifiable", name.map(String::as_str), h),
        (Cell::Drift, _) => finding("recalibrate", None, h),
        (_, Some(name)) => finding("named", Some(name), h),
        (_, None) => finding("unexplained", None, h),
    };
    let findings: Vec<Value> = truth.hidden.iter().map(one).collect();
    let quiet = truth.hidden.is_empty() || truth.asked.cell == Cell::Blind;
    json!({
        "verdict": if quiet { "match" } else { "mismatch" },
        "findings": findings, "after": {"verdict": "match"}, "cannot_tell": [],
    })
}

fn trial() -> Vec<Truth> {
    let mut all = Vec::new();
    for (i, name) in CATALOGUE.iter().enumerate() {
        all.push(truth(Cell::Single, &[name], [5.0, 15.0, 50.0, 150.0][i % 4]));
        all.push(truth(Cell::Pair, &[name, CATALOGUE[(i + 7) % 29]], 50.0));
    }
    for _ in 0..6 {
        all.push(truth(Cell::Null, &[], 50.0));
        all.push(truth(Cell::Outside, &["seam"], 50.0));
        all.push(truth(Cell::Drift, &["recalibrate"], 50.0));
        all.push(truth(Cell::Blind, &["depth-scale"], 50.0));
    }
    all
}

fn judged(truths: &[Truth], verdicts: &[Value]) -> (Vec<Marks>, Scores) {
    let pairs = || truths.iter().zip(verdicts);
    let marks: Vec<Marks> = pairs().map(|(t, v)| mark(t, Some(v)).unwrap()).collect();
    let nobody = BTreeMap::new();
    let all: Vec<Judged<'_>> = truths
        .iter()
        .zip(&marks)
        .map(|(truth, marks)| Judged { truth, marks, gains: None, named_by_others: &nobody })
        .collect();
    let scores = scores(&all);
    (marks, scores)
}

const BAD: [&str; 3] = ["false_alarm", "masquerade", "confident_wrong"];

#[test]
fn perfect_answers_score_one_in_everything() {
    let truths = trial();
    let verdicts: Vec<Value> = truths.iter().map(perfect).collect();
    let (marks, scores) = judged(&truths, &verdicts);
    for (name, rate) in &scores.all {
        let right = if BAD.contains(&name.as_str()) { 0.0 } else { 1.0 };
        assert_eq!(rate.rate, right, "{name}");
    }
    assert!(scores.all.len() >= 14, "{:?}", scores.all.keys());
    assert_eq!((scores.names_f1, scores.overlap), (Some(1.0), Some(1.0)));
    assert_eq!(scores.parameter_error, Some(0.0));
    assert_eq!(scores.coverage.unwrap().rate, 1.0);
    assert_eq!((scores.certainty.ece, scores.certainty.brier), (Some(0.0), Some(0.0)));
    assert!(
        marks.iter().flat_map(|m| &m.parameters).all(|p| p.name == "k_px"),
        "shared names only"
    );
    let values: Vec<Option<f64>> = scores.endpoints.iter().map(|e| e.value).collect();
    assert_eq!(values, [Some(0.0), Some(1.0), None, Some(1.0), None]);
}

#[test]
fn answers_to_other_questions_score_near_zero() {
    let truths = trial();
    let mut verdicts: Vec<Value> = truths.iter().map(perfect).collect();
    verdicts.rotate_left(9);
    let (_, scores) = judged(&truths, &verdicts);
    for mark in ["first_name", "exact", "abstained", "recalibrate"] {
        assert!(scores.all[mark].rate < 0.1, "{mark}: {:?}", scores.all[mark]);
    }
    for mark in ["false_alarm", "confident_wrong"] {
        assert!(scores.all[mark].rate > 0.4, "{mark}: {:?}", scores.all[mark]);
    }
    assert!(scores.certainty.brier.unwrap() > 0.8);
}

#[test]
fn no_diagnosis_is_wrong_in_everything() {
    for truth in trial() {
        let marks = mark(&truth, None).unwrap();
        assert_eq!(marks.first, "failed");
        let wrong = |name: &str| name == "false_alarm";
        for (name, mark) in marks.yes_no() {
            let silent = ["masquerade", "confident_wrong"].contains(&name);
            assert!(mark.is_none_or(|m| m == wrong(name)) || silent, "{name}: {mark:?}");
        }
    }
}

/// The perfect answer to a single cause with `change` made to its finding.
fn slip(change: impl Fn(&mut Value)) -> Marks {
    let truth = truth(Cell::Single, &["vignetting"], 50.0);
    let mut verdict = perfect(&truth);
    change(&mut verdict["findings"][0]);
    mark(&truth, Some(&verdict)).unwrap()
}

#[test]
fn single_slips_cost_what_they_should() {
    let second = slip(|f| {
        f["effect"] = "slope-noise".into();
        f["status"] = "one-of".into();
        f["alternatives"] = json!([
            {"effect": "slope-noise", "probability": 0.6},
            {"effect": "vignetting", "probability": 0.3},
        ]);
    });
    assert_eq!((second.first_name, second.in_two), (Some(false), Some(true)));
    assert_eq!((second.exact, second.confident_wrong), (Some(false), Some(false)));
    assert_eq!(second.advice, Some(false), "one of two, and no view was proposed");
    let right: Vec<bool> = second.stated.iter().map(|s| s.right).collect();
    assert_eq!(right, [false, true]);

    let shifted = slip(|f| f["interval"] = json!([0.4, 0.8]));
    assert!((shifted.overlap.unwrap() - 0.2 / 0.6).abs() < 1e-12);
    let off_axis = slip(|f| f["axis"] = "row".into());
    assert_eq!((off_axis.axis, off_axis.first_name), (Some(false), Some(true)));
    assert_eq!(off_axis.overlap, None, "another axis has no common stretch");

    let off = slip(|f| f["parameters"]["k_px"] = json!({"value": 0.6, "std_error": 0.05}));
    assert!((off.parameters[0].relative_error - 0.2).abs() < 1e-12);
    assert_eq!(off.parameters[0].covered, Some(false), "two standard errors are not 90 %");
    let near = slip(|f| f["parameters"]["k_px"] = json!({"value": 0.58, "std_error": 0.05}));
    assert_eq!(near.parameters[0].covered, Some(true));

    let unsure = slip(|f| f["status"] = "not-identifiable".into());
    assert_eq!((unsure.detected, unsure.first.as_str()), (Some(false), "nothing"));
}

#[test]
fn a_name_for_what_the_catalogue_lacks_is_a_masquerade_only_when_it_is_said_for_certain() {
    let truth = truth(Cell::Outside, &["seam"], 50.0);
    let with = |probability: f64| {
        let mut verdict = perfect(&truth);
        verdict["findings"][0]["status"] = "named".into();
        verdict["findings"][0]["effect"] = "column-banding".into();
        verdict["findings"][0]["alternatives"] =
            json!([{"effect": "column-banding", "probability": probability}]);
        mark(&truth, Some(&verdict)).unwrap()
    };
    assert_eq!((with(0.95).masquerade, with(0.95).abstained), (Some(true), Some(false)));
    assert_eq!(with(0.8).masquerade, Some(false));
}

#[test]
fn distance_and_disparity_are_one_axis_and_a_label_may_have_several() {
    let mut truth = truth(Cell::Single, &["range-exponent"], 50.0);
    truth.hidden[0].axis = "z".into();
    truth.hidden[0].also = vec!["theta".into()];
    let on = |axis: &str| {
        let mut verdict = perfect(&truth);
        verdict["findings"][0]["axis"] = axis.into();
        mark(&truth, Some(&verdict)).unwrap().axis
    };
    assert_eq!(["z", "disparity", "theta", "row"].map(on), [true, true, true, false].map(Some));
}

#[test]
fn what_its_world_reached_counts_not_what_was_ordered() {
    let mut truth = truth(Cell::Single, &["vignetting"], 150.0);
    assert_eq!(super::scores::level(&truth), Some(150.0));
    truth.hidden[0].nats = Some(19.0);
    assert_eq!(super::scores::level(&truth), Some(15.0));
}

/// The border between two strengths is their geometric mean, for 15 and 50 the root of 750.
#[test]
fn fifty_begins_half_way_from_fifteen() {
    let limit = 750f64.sqrt();
    let mut truth = truth(Cell::Pair, &["vignetting", "lens-distortion"], 150.0);
    for (nats, is_worth) in [(1.0001 * limit, true), (0.9999 * limit, false), (0.0, false)] {
        truth.hidden[1].nats = Some(nats);
        assert_eq!(super::worth(&truth), is_worth, "{nats}");
    }
    truth.hidden.clear();
    assert!(!super::worth(&truth), "nothing is hidden");
}
