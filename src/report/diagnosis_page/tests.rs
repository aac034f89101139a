mod cases;

use cases::{cases, diagnosis, finding, picture};

use super::*;
use crate::diagnose::{Curve, Size, Status};

fn rendered(diagnosis: &Diagnosis) -> String {
    diagnosis_page(&DiagnosisPage { title: "Kinect & co", diagnosis, pictures: &[picture()] })
        .unwrap()
}

/// The text of a page without pictures, style and tags; one space between words.
fn text(page: &str) -> String {
    let without = |page: &str, from: &str, to: &str| {
        let mut parts = page.split(from);
        let first = parts.next().unwrap_or_default().to_string();
        parts
            .fold(first, |text, part| text + " " + part.split_once(to).map_or("", |(_, rest)| rest))
    };
    let page = without(&without(page, "<style>", "</style>"), "<svg", "</svg>");
    let words = without(&page, "<", ">");
    words.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What the page of each case must say.
const SAYS: [(&str, &[&str]); 8] = [
    (
        "named",
        &[
            "The model leaves one effect out: radial disparity bias.",
            "1.84 mm rms, 0.42 times the noise of a single reading",
            "Chance alone does this about once in 2,500 recordings (p = 4·10 −4 )",
            "97 % radial disparity bias : lens or projector",
            "Distance from the picture's centre: 118 to 398 px",
            "0.312 ± 0.012 px",
            "3.12 mm → 1.17 mm",
            "match. Nothing differs beyond chance.",
            "42 nats a view (95 % interval 31 to 55",
            "−4213.2 −4170.9",
        ],
    ),
    (
        "several",
        &[
            "leaves three effects out: radial disparity bias, noise with another power of distance and an unexplained error over the row of the picture.",
            "1.6 to 3.4 m",
            "less than once in a million recordings (p &lt; 10 −6 )",
            "a few more large errors than simulated (p = 0.012)",
            "Distribution of the noise",
        ],
    ),
    (
        "one-of",
        &[
            "Radial disparity bias or a bent target",
            "38 % a bent target : the board is bent",
            "hold the target 0.80 m in front of the sensor, tilted by 45° , its right side farthest away",
            "5 % none of these",
        ],
    ),
    (
        "unexplained",
        &["Its curve: a step at row 317, −0.08 px above", "measured, not in the catalogue"],
    ),
    ("recalibrate", &["The model lacks no effect", "Run “kinoise calibrate”"]),
    (
        "not-identifiable",
        &["Measure the distance from sensor to target with a tape", "0.6 to 3.9 m"],
    ),
    (
        "match",
        &[
            "The model explains this recording",
            "(radial disparity bias and a bent target)",
            "sagitta 0.62 mm , at a span of 1.0 m",
            "A wrong depth scale : A flat board stays flat under it",
        ],
    ),
    ("inconclusive", &["does not settle whether the model is right.", "4 views are too few"]),
];

#[test]
fn every_page_says_what_matters() {
    for ((case, diagnosis), (name, says)) in cases().into_iter().zip(SAYS) {
        assert_eq!(case, name);
        let text = text(&rendered(&diagnosis));
        for words in says {
            assert!(text.contains(words), "{case} does not say {words:?}:\n{text}");
        }
    }
}

#[test]
fn pages_are_whole_and_escaped() {
    for (case, diagnosis) in cases() {
        let page = rendered(&diagnosis);
        assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>"), "{case}");
        let escaped = ["office &lt;b&gt; &amp; co", "view &lt;i&gt;", "facing &lt;the&gt; sensor"];
        assert!(escaped.iter().all(|words| page.contains(words)), "{case}");
        assert!(!page.contains("<b> & co") && !page.contains("<script"), "{case}");
        assert!(!text(&page).contains("NaN") && !page.contains("src=\"http"), "{case}");
        assert_eq!(page.matches("data:image/png;base64,").count(), 3, "{case}");
    }
}

#[test]
fn odd_numbers_do_not_break_a_page() {
    let mut odd = finding(Status::Named, Some("of-tomorrow"));
    odd.size = Size { mm: f64::NAN, sigma: f64::NAN };
    odd.share = f64::NAN;
    odd.p_adjusted = f64::NAN;
    odd.interval = [f64::NEG_INFINITY, f64::INFINITY];
    odd.curve = Some(Curve::default());
    let page = rendered(&diagnosis(Verdict::Mismatch, vec![odd]));
    let text = text(&page);
    assert!(text.contains("Of-tomorrow") && text.contains("over its whole range"));
    assert!(!text.contains("NaN") && !page.contains("width:NaN"));
    let torn = Picture { before: vec![0.0; 3], ..picture() };
    let diagnosis = diagnosis(Verdict::Match, vec![]);
    let page = DiagnosisPage { title: "", diagnosis: &diagnosis, pictures: &[torn] };
    assert!(diagnosis_page(&page).is_err());
}
