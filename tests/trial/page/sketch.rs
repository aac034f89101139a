//! A finding's curve, small enough that a page holds a hundred and fifty of them.

use std::fmt::Write as _;

use maud::{Markup, PreEscaped, html};

use crate::KeptCurve;
use kinoise::report::numbers::significant;
use kinoise::stats::range;

const WIDTH: f64 = 260.0;
const HEIGHT: f64 = 110.0;
const EDGE: f64 = 5.0;
/// A bar longer than this many times the curve's height is cut.
const LONGEST_BAR: f64 = 1.0;
/// More points than this are thinned.
const MOST: usize = 60;

/// `None` where there is nothing to be seen.
pub(super) fn sketch(curve: &KeptCurve) -> Option<Markup> {
    let pick = |values: &[Option<f64>], i: usize| {
        values.get(i).copied().flatten().filter(|v| v.is_finite())
    };
    let step = curve.x.len().div_ceil(MOST).max(1);
    let mut points = Vec::new();
    let mut line = Vec::new();
    for i in (0..curve.x.len()).step_by(step) {
        let Some(x) = pick(&curve.x, i) else { continue };
        points
            .extend(pick(&curve.y, i).map(|y| [x, y, pick(&curve.y_std_error, i).unwrap_or(0.0)]));
        line.extend(pick(&curve.model, i).map(|y| [x, y]));
    }
    line.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let xs = range(points.iter().map(|p| p[0]).chain(line.iter().map(|p| p[0])));
    let ys = range(points.iter().map(|p| p[1]).chain(line.iter().map(|p| p[1])));
    let tall = LONGEST_BAR * (ys[1] - ys[0]);
    let ends = points.iter().flat_map(|p| [p[1] - p[2].min(tall), p[1] + p[2].min(tall)]);
    let ys = range(ends.chain(ys));
    (xs[1] > xs[0] && ys[1] > ys[0]).then(|| {
        html! {
            div.sketch {
                p.axis { (curve.y_label) ": " (ends_of(ys)) }
                (PreEscaped(svg(&points, &line, xs, ys)))
                p.axis { (curve.x_label) ": " (ends_of(xs)) }
            }
        }
    })
}

fn ends_of([low, high]: [f64; 2]) -> Markup {
    html! { (significant(low, 3)) " to " (significant(high, 3)) }
}

/// Numbers only: nothing to escape.
fn svg(points: &[[f64; 3]], line: &[[f64; 2]], xs: [f64; 2], ys: [f64; 2]) -> String {
    let across = |x: f64| EDGE + (x - xs[0]) / (xs[1] - xs[0]) * (WIDTH - 2.0 * EDGE);
    let up = |y: f64| {
        let share = ((y - ys[0]) / (ys[1] - ys[0])).clamp(0.0, 1.0);
        HEIGHT - EDGE - share * (HEIGHT - 2.0 * EDGE)
    };
    let mut out = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" aria-hidden=\"true\"><path class=\"g\" d=\"M0 0H{WIDTH}V{HEIGHT}H0Z"
    );
    if ys[0] < 0.0 && ys[1] > 0.0 {
        let _ = write!(out, "M0 {:.1}H{WIDTH}", up(0.0));
    }
    out += "\"/>";
    let (mut bars, mut dots) = (String::new(), String::new());
    for &[x, y, error] in points {
        let _ = write!(dots, "M{:.1} {:.1}h0", across(x), up(y));
        if error > 0.0 {
            let _ = write!(bars, "M{:.1} {:.1}V{:.1}", across(x), up(y - error), up(y + error));
        }
    }
    let line: Vec<String> =
        line.iter().map(|p| format!("{:.1} {:.1}", across(p[0]), up(p[1]))).collect();
    if line.len() > 1 {
        let _ = write!(out, "<path class=\"m\" d=\"M{}\"/>", line.join("L"));
    }
    for (class, path) in [("e", bars), ("p", dots)] {
        if !path.is_empty() {
            let _ = write!(out, "<path class=\"{class}\" d=\"{path}\"/>");
        }
    }
    out + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_leave_no_trace_and_labels_are_escaped() {
        let some = |v: &[f64]| v.iter().map(|v| Some(*v)).collect::<Vec<_>>();
        let curve = KeptCurve {
            x_label: "depth < 1".into(),
            y_label: "y".into(),
            x: some(&[0.0, 1.0, 2.0]),
            y: vec![Some(1.0), None, Some(2.0)],
            y_std_error: vec![Some(0.1), None, Some(90.0)],
            model: vec![None; 3],
        };
        let text = sketch(&curve).unwrap().into_string();
        assert!(text.contains("depth &lt; 1: 0 to 2.00") && !text.contains("NaN"), "{text}");
        assert_eq!(text.matches("h0").count(), 2);
        assert_eq!(sketch(&KeptCurve::default()).map(Markup::into_string), None);
    }
}
