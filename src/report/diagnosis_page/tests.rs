use serde_json::{Map, Value, json};

use super::*;
use crate::diagnose::*;
use crate::terms::{Axis, Basis, Coordinate, Modulation, Statistic, Term};

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

fn finding(status: Status, effect: Option<&'static str>) -> Finding {
    Finding {
        status,
        effect,
        alternatives: Vec::new(),
        statistic: Statistic::Bias,
        axis: Axis::Radius,
        interval: [118.0, 398.0],
        unit: "px",
        share: 0.63,
        minor: false,
        parameters: Map::new(),
        size: Size { mm: 1.84, sigma: 0.42 },
        p_adjusted: Some(0.0004),
        replicated: Some(true),
        physics: String::new(),
        next_view: None,
        of_some: None,
        contradicted: None,
        shape: None,
        curve: None,
        terms: Vec::new(),
        covariance: crate::model::Covariance::default(),
    }
}

fn bowl(status: Status, others: [(&'static str, f64); 2]) -> Finding {
    let alternatives =
        others.map(|(effect, probability)| Alternative { effect, probability: Some(probability) });
    Finding {
        alternatives: alternatives.into(),
        parameters: map(json!({"k_px": {"value": 0.3123, "std_error": 0.0121}})),
        terms: vec![Term::bias(
            Basis::powers(Coordinate::RadiusSquared, 1, Modulation::One),
            vec![0.3123],
        )],
        physics: "a bent board would move with the board & not stay in the picture".into(),
        curve: curve("radius (px)", 398.0, |r| 0.31 * (r / 398.0).powi(2) - 0.1),
        ..finding(status, Some("radial-disparity-bias"))
    }
}

fn unexplained() -> Finding {
    Finding {
        axis: Axis::Row,
        interval: [301.0, 332.0],
        shape: Some("a step at row 317, −0.08 px above and +0.08 px below".into()),
        physics:
            "Unexplained: the mean error depends on the row: a step at row 317, −0.08 px above"
                .into(),
        curve: curve("row (px)", 479.0, |v| if v < 317.0 { -0.08 } else { 0.08 }),
        ..finding(Status::Unexplained, None)
    }
}

fn diagnosis(verdict: Verdict, findings: Vec<Finding>) -> Diagnosis {
    let nothing = findings.is_empty();
    let view = |i: usize| ViewLine {
        name: format!("<view>-{i:02}"),
        z_m: 0.6 + 0.3 * i as f64,
        theta_rad: 0.2 * (i % 4) as f64,
        azimuth_rad: 1.5,
        frames: 30,
        pixels: 48_211,
        bowl_px_before: 0.121,
        bowl_px_after: 0.018,
        held_out: i.is_multiple_of(4),
    };
    let row = |i: usize| MapRow {
        statistic: [Statistic::Bias, Statistic::Variance, Statistic::Dropout][i % 3],
        axis: [Axis::Radius, Axis::Z, Axis::Theta][i % 3],
        interval: [[118.0, 398.0], [1.62, 3.4], [0.7, 1.1]][i % 3],
        unit: ["px", "m", "rad"][i % 3],
        effect_size: 0.42 / (1.0 + i as f64),
        p_adjusted: 1e-4 * (1.0 + i as f64).powi(2),
    };
    let heldout = HeldOut {
        views: vec!["view-00".into(), "view-04".into(), "view-08".into()],
        log_score_before: -4213.2,
        log_score_after: -4170.9,
        gain: 42.31,
        gain_interval: [31.2, 55.0],
        bias_gain_interval: [31.2, 55.0],
        is_clear: true,
        bias_is_clear: true,
        rms_mm_before: 3.12,
        rms_mm_after: 1.17,
        rms_px_before: 0.214,
        rms_px_after: 0.181,
        correction_rms_before_px: 0.214,
        correction_rms_after_px: 0.190,
    };
    let smallest = |effect, minimum| Detectable { effect, minimum: map(minimum) };
    let why = "a flat board stays flat under it; measured distances would show it".into();
    Diagnosis {
        format: DIAGNOSIS_FORMAT,
        recording: "office <b> & co".into(),
        reference: Reference::Model,
        verdict,
        findings,
        map: (0..if nothing { 0 } else { 15 }).map(row).collect(),
        heldout: (!nothing).then_some(heldout),
        after: After { verdict: Verdict::Match, remaining: Vec::new() },
        detectable: vec![
            smallest("radial-disparity-bias", json!({"k_px": 0.021})),
            smallest("target-bow", json!({"sagitta_m": 0.00062, "span_m": 1.0})),
        ],
        cannot_tell: vec![CannotTell { effect: "depth-scale", why }],
        views: (0..12).map(view).collect(),
        remarks: vec!["view <i>: one frame is missing".into()],
    }
}

/// Diagnoses of every kind, with what the page of each must say.
fn cases() -> [(Diagnosis, &'static [&'static str]); 9] {
    use Verdict::{Inconclusive, Match, Mismatch};
    let named = bowl(Status::Named, [("radial-disparity-bias", 0.97), ("lens-distortion", 0.02)]);
    let noise = Finding {
        statistic: Statistic::Variance,
        axis: Axis::Z,
        interval: [1.62, 3.4],
        unit: "m",
        p_adjusted: Some(1e-9),
        ..finding(Status::Named, Some("range-exponent"))
    };
    let mut several = diagnosis(Mismatch, vec![named.clone(), noise, unexplained()]);
    several.after.remaining = vec![Remaining {
        statistic: Statistic::Distribution,
        axis: Axis::Residual,
        share: 0.004,
        p_adjusted: Some(0.012),
        words: "a few more large errors than simulated".into(),
    }];
    let mut one_of = bowl(Status::OneOf, [("radial-disparity-bias", 0.57), ("target-bow", 0.38)]);
    one_of.next_view = Some(NextView {
        z_m: 0.8,
        theta_rad: 0.785,
        azimuth_rad: 0.05,
        separation_now: 0.4,
        separation_then: 6.0,
        chance: 0.8,
        why: "a bent board moves with the board".into(),
    });
    let tape = Finding {
        axis: Axis::Z,
        interval: [0.6, 3.9],
        unit: "m",
        ..finding(Status::NotIdentifiable, Some("depth-scale"))
    };
    let mut unsettled = diagnosis(Inconclusive, vec![]);
    unsettled.remarks.push("4 views are too few to set any aside".into());
    [
        (
            diagnosis(Mismatch, vec![named]),
            &[
                "1.84 mm rms, 0.42 times the noise of a single reading",
                "Chance alone does this about once in 2,500 recordings (p = 4·10 −4 )",
                "97 % radial disparity bias : lens or projector",
                "Distance from the picture's centre: 118 to 398 px",
                "0.312 ± 0.012 px",
                "3.12 mm → 1.17 mm",
                "The model does not reproduce this recording. Radial disparity bias: 1.84 mm rms, 0.42 of the noise, 63 % of the mismatch",
                "On three views kept aside",
                "What to do next # Take the errors out: kinoise correct 'a b' Recorded",
                "kinoise correct takes it out",
                "match. Nothing differs beyond chance.",
                "42 nats a view (95 % interval 31 to 55",
                "−4213.2 −4170.9",
            ],
        ),
        (
            several,
            &[
                "largest: radial disparity bias",
                "Noise with another power of distance: 1.84 mm rms",
                "An unexplained bias over the row of the picture (a step at row 317",
                "1.6 to 3.4 m",
                "less than once in a million recordings (p &lt; 10 −6 )",
                "a few more large errors than simulated (p = 0.012)",
                "Distribution of the noise",
            ],
        ),
        (
            diagnosis(Mismatch, vec![one_of]),
            &[
                "Radial disparity bias or a bent target",
                "38 % a bent target : the board is bent",
                "hold the target 0.80 m in front of the sensor, tilted by 45° , its right side farthest away",
                "5 % none of these",
            ],
        ),
        (
            diagnosis(Mismatch, vec![unexplained()]),
            &[
                "depends on the row: a step at row 317, −0.08 px above.",
                "measured, not in the catalogue",
            ],
        ),
        (
            diagnosis(Mismatch, vec![Finding { contradicted: Some("row-noise"), ..unexplained() }]),
            &[
                "Row noise, which the recording contradicts: 1.84 mm rms",
                "not in the recording",
                "the model has what the recording does not show",
            ],
        ),
        (
            diagnosis(Mismatch, vec![finding(Status::Recalibrate, None)]),
            &["Parameters that are off: 1.84 mm rms", "Run kinoise calibrate again"],
        ),
        (
            diagnosis(Inconclusive, vec![tape]),
            &["Measure the distance from sensor to target with a tape", "0.6 to 3.9 m"],
        ),
        (
            diagnosis(Match, vec![]),
            &[
                "The model reproduces this recording.",
                "Take the errors out: kinoise correct 'a b'",
                "(radial disparity bias and a bent target)",
                "sagitta 0.62 mm , at a span of 1.0 m",
                "A wrong depth scale : A flat board stays flat under it",
            ],
        ),
        (
            unsettled,
            &["Whether the model reproduces this recording is not settled.", "4 views are too few"],
        ),
    ]
}

fn picture() -> ViewPictures {
    let pixels = |bowl: f32| -> Vec<f32> {
        (0..16 * 12).map(|i| if i % 16 == 0 { f32::NAN } else { bowl * i as f32 }).collect()
    };
    let [before, after, twin] = [2e-3, 0.0, 1.9e-3].map(pixels);
    ViewPictures { view: 8, width: 16, height: 12, before, after, twin: Some(twin) }
}

fn rendered(diagnosis: &Diagnosis, picture: ViewPictures) -> Result<String> {
    let origin = &Origin { recording: "rec".into(), ..Origin::default() };
    let steps =
        &[Step { why: "Take the errors out: ".into(), command: "kinoise correct 'a b'".into() }];
    let (title, shown) = ("Kinect & co", &[picture]);
    diagnosis_page(&DiagnosisPage { title, diagnosis, pictures: shown, steps, origin })
}

/// The text of a page without pictures, style and tags, with single spaces.
fn text(page: &str) -> String {
    let without = |page: &str, from: &str, to: &str| {
        let (first, parts) = page.split_once(from).unwrap_or((page, ""));
        let rest = parts.split(from).map(|part| part.split_once(to).map_or("", |(_, rest)| rest));
        std::iter::once(first).chain(rest).collect::<Vec<_>>().join(" ")
    };
    let page = without(&without(page, "<style>", "</style>"), "<svg", "</svg>");
    let page = without(&page, "<script>", "</script>");
    without(&page, "<", ">").split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn every_page_is_whole_escaped_and_says_what_matters() {
    for (diagnosis, says) in cases() {
        let page = rendered(&diagnosis, picture()).unwrap();
        let text = text(&page);
        for words in says {
            assert!(text.contains(words), "{words:?} is not said:\n{text}");
        }
        assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>"));
        let escaped = ["office &lt;b&gt; &amp; co", "view &lt;i&gt;", "View &lt;view&gt;-08:"];
        assert!(escaped.iter().all(|words| page.contains(words)), "{text}");
        assert!(!page.contains("<b> & co") && !text.contains('`'), "{text}");
        assert!(!text.contains("NaN") && !page.contains("src=\"http"), "{text}");
        assert_eq!(page.matches("data:image/png;base64,").count(), 3);
    }
}

#[test]
fn odd_numbers_do_not_break_a_page() {
    let mut odd = finding(Status::Named, Some("of-tomorrow"));
    odd.size = Size { mm: f64::NAN, sigma: f64::NAN };
    odd.share = f64::NAN;
    odd.p_adjusted = None;
    odd.interval = [f64::NEG_INFINITY, f64::INFINITY];
    odd.curve = Some(Curve::default());
    let diagnosis = diagnosis(Verdict::Mismatch, vec![odd]);
    let page = rendered(&diagnosis, picture()).unwrap();
    let text = text(&page);
    assert!(text.contains("Of-tomorrow") && text.contains("over its whole range"));
    assert!(!text.contains("NaN") && !page.contains("width:NaN"));
    let torn = ViewPictures { before: vec![0.0; 3], ..picture() };
    assert!(rendered(&diagnosis, torn).is_err());
}

/// Only what the model holds, and `correct` can undo, is said to be taken out or to be in the model.
#[test]
fn what_to_do_about_a_cause_is_what_the_model_can() {
    let told = |effect, parameters: Value| {
        let parameters = map(parameters);
        table::advice(&Finding { parameters, ..finding(Status::Named, Some(effect)) })
    };
    let measured = |name: &str| json!({name: {"value": 0.1, "std_error": 0.01}});
    let corrected = "`kinoise correct` takes it out";
    assert_eq!(told("column-banding", measured("amplitude_px")), corrected);
    assert_eq!(told("pixel-locking", measured("amplitude_px")), corrected);
    assert_eq!(told("thermal-drift", measured("relative")), corrected);
    assert!(told("thermal-drift", json!({})).contains("strength was not measured"));
    assert!(told("frame-jitter", json!({})).contains("strength was not measured"));
    let jitter = finding(Status::Named, Some("row-noise"));
    let some = Finding { of_some: Some([5, 20]), ..jitter };
    assert!(table::advice(&some).contains("leaves it out"));
    // A bias over the light can be simulated; depth images alone do not tell it.
    let light = Term::bias(Basis::powers(Coordinate::Light, 1, Modulation::One), vec![0.1]);
    let lit = Finding { terms: vec![light], ..finding(Status::Named, Some("vignetting")) };
    assert_eq!(table::advice(&lit), "nothing: the extended model has it");
}

/// The number of views is told once, for findings with and without a name.
#[test]
fn what_some_views_have_is_told_of_those() {
    let of = |f: Finding| {
        let f = Finding { of_some: Some([5, 20]), ..f };
        diagnosis(Verdict::Mismatch, vec![f])
    };
    let some = |f: Finding| story(&of(f)).remove(0);
    let rows = || finding(Status::Named, Some("row-noise"));
    let told = some(rows());
    assert!(told.contains(", in 5 of 20 views: "), "{told}");
    let shape = Some("in 5 of 20 views".to_string());
    let told = some(Finding { shape, ..finding(Status::Unexplained, None) });
    assert_eq!(told.matches("in 5 of 20 views").count(), 1, "{told}");
}

/// Verdict and story together; minor and further findings share a sentence.
#[test]
fn a_story_has_seven_sentences_at_most() {
    let part = |share, minor| Finding {
        share,
        minor,
        replicated: Some(share < 0.2),
        ..bowl(Status::Named, [("radial-disparity-bias", 0.97), ("lens-distortion", 0.02)])
    };
    let shares = [0.5, 0.2, 0.15, 0.1, 0.04, 0.006, 0.004];
    let mut told = diagnosis(Verdict::Mismatch, shares.map(|s| part(s, s < 0.01)).to_vec());
    told.after.verdict = Verdict::Mismatch;
    let story = story(&told);
    assert!(story.len() <= 6, "{story:#?}");
    assert!(story[0].contains("50 % of the mismatch") && story[0].contains("do not agree"));
    assert!(!story[2].contains("do not agree"), "{}", story[2]);
    assert!(story[3].contains("14 % of it together; small remains"), "{}", story[3]);
    assert!(story[3].contains("1.0 % of it together"), "{}", story[3]);
    for (diagnosis, _) in cases() {
        let story = super::story(&diagnosis);
        assert!(story.len() <= 6 && story.iter().all(|s| !s.contains("NaN")), "{story:#?}");
    }
}

/// Only where there was a search can the page say that it finds nothing without the held-out views.
#[test]
fn that_views_kept_aside_gain_nothing_is_told_of_what_was_searched() {
    let said = |terms: Vec<Term>| {
        let mut nothing = diagnosis(Verdict::Mismatch, vec![Finding { terms, ..unexplained() }]);
        nothing.heldout.as_mut().expect("views kept aside").gain_interval = [0.0; 2];
        story::gained(&nothing)
    };
    assert_eq!(said(Vec::new()), None);
    let searched = said(vec![Term::bias(Basis::Level, vec![1.0])]);
    assert!(searched.is_some_and(|s| s.starts_with("On three views kept aside nothing is gained")));
}
