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
            "The simulation leaves one thing out: a flat wall comes out as a shallow bowl",
            "1.84 mm typically, which is 0.42 times the noise of a single reading",
            "97 % that this is the cause; chance alone would look like this about once in 2,500 times (p = 4·10 −4 )",
            "Distance from the middle of the picture: 118 to 398 px",
            "0.312 ± 0.012 px",
            "3.12 mm → 1.17 mm",
            "Nothing beyond chance",
            "42 nats a view (95 % between 31 and 55)",
        ],
    ),
    (
        "several",
        &[
            "leaves three things out: a bowl in the depth, noise that grows with distance in another way and something without a name that follows the row of the picture",
            "1.6 to 3.4 m",
            "less than once in a million times (p &lt; 10 −6 )",
            "a few more large errors than simulated (p = 0.012)",
        ],
    ),
    (
        "one-of",
        &[
            "A bowl in the depth or a bent board",
            "55 % a bowl in the depth, 38 % a bent board",
            "hold the board 0.80 m in front of the sensor, turned 45° away from facing it, its right side farthest away",
            "None of these 5 %",
        ],
    ),
    ("unexplained", &["Its curve: a step at row 317, −0.08 px above", "measured, no known name"]),
    ("recalibrate", &["Nothing is missing from the simulation", "Run “kinoise calibrate”"]),
    (
        "not-identifiable",
        &["Measure the distance from sensor to board with a tape", "0.6 to 3.9 m"],
    ),
    (
        "match",
        &[
            "The simulation explains this recording",
            "Known causes (a bowl in the depth, ripples of depth and a bent board)",
            "sagitta 0.62 mm , at a span of 1.0 m",
            "A wrong scale of depth : A flat board stays flat under it",
        ],
    ),
    ("inconclusive", &["does not settle whether the simulation is right.", "4 views are too few"]),
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
        assert!(
            page.contains("office &lt;b&gt; &amp; co") && page.contains("view &lt;i&gt;"),
            "{case}"
        );
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
    assert!(
        diagnosis_page(&DiagnosisPage { title: "", diagnosis: &diagnosis, pictures: &[torn] })
            .is_err()
    );
}

/// Writes the pages to look at: `cargo test --lib pages_to_look_at -- --ignored`.
#[test]
#[ignore = "for the eye"]
fn pages_to_look_at() {
    let folder = std::env::temp_dir().join("kinoise-diagnosis-pages");
    std::fs::create_dir_all(&folder).unwrap();
    for (case, diagnosis) in cases() {
        std::fs::write(folder.join(format!("{case}.html")), rendered(&diagnosis)).unwrap();
    }
}
