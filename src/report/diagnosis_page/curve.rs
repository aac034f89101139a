//! A finding's curve: measured points with error bars, and the line of the extended model.

use crate::diagnose::Curve;
use crate::report::axis::Axis;
use crate::report::chart::{Chart, Layer, Mark, Stroke};
use crate::report::colours::{ACCENT, FAINT, INK};
use crate::report::numbers::{decimals_for, fixed};
use crate::stats::range;

/// Number of points above which their marks shrink.
const MANY: usize = 40;
/// Share of the range left free at each end.
const MARGIN: f64 = 0.06;
/// Half-length of the longest error bar that still sets the scale, in units of the curve's height.
const MAX_BAR: f64 = 1.5;
/// Largest distance of zero from the curve at which it is included, in units of the curve's height.
const MAX_ZERO: f64 = 0.6;

/// The chart of a curve; `None` if nothing was measured.
pub(super) fn chart(curve: &Curve) -> Option<Chart> {
    let line = points(curve, &curve.model);
    let marks = points(curve, &curve.y);
    let bars = curve.x.iter().zip(&curve.y).zip(&curve.y_std_error);
    let bars = bars.map(|((x, y), error)| [*x, y - error, y + error]);
    let bars: Vec<[f64; 3]> = bars.filter(|bar| bar.iter().all(|v| v.is_finite())).collect();
    let xs = range(marks.iter().chain(&line).map(|p| p[0]));
    if marks.is_empty() {
        return None;
    }
    let heights = heights(range(marks.iter().chain(&line).map(|p| p[1])), &bars);
    let axes = [xs, heights].map(|ends| Axis::with_margin(ends, MARGIN));
    let mut chart = Chart::small(axes, [&curve.x_label, &curve.y_label]);
    let zero = [chart.x.low, chart.x.high].map(|x| [x, 0.0]).to_vec();
    let tip = |[x, y]: &[f64; 2]| {
        let (x_text, y_text) = (fixed(*x, decimals_for(x.abs())), fixed(*y, decimals_for(y.abs())));
        ([*x, *y], format!("{}: {x_text}; {}: {y_text}", curve.x_label, curve.y_label))
    };
    chart.tips = marks.iter().map(tip).collect();
    let radius = if marks.len() > MANY { 2 } else { 4 };
    chart.layers = vec![
        Layer::Line(zero, Stroke::new(FAINT, 1).dashed([5, 4])),
        Layer::Line(line, Stroke::new(ACCENT, 3)),
        Layer::ErrorBars(bars, Stroke::new(INK, 1)),
        Layer::Marks(marks, Mark::dot(INK, radius)),
    ];
    Some(chart)
}

/// The finite `values` over the curve's x, sorted by x.
fn points(curve: &Curve, values: &[f64]) -> Vec<[f64; 2]> {
    let pairs = curve.x.iter().zip(values).map(|(x, y)| [*x, *y]);
    let mut known: Vec<_> = pairs.filter(|p| p.iter().all(|v| v.is_finite())).collect();
    known.sort_by(|a, b| a[0].total_cmp(&b[0]));
    known
}

/// Range of y: points, line, zero if it is near, and those error bars that do not dwarf them.
fn heights([low, high]: [f64; 2], bars: &[[f64; 3]]) -> [f64; 2] {
    let far = MAX_ZERO * (high - low);
    let zero = (low <= far && high >= -far).then_some(0.0);
    let [low, high] = range([low, high].into_iter().chain(zero));
    let longest = 2.0 * MAX_BAR * (high - low);
    let short = bars.iter().filter(|bar| bar[2] - bar[1] <= longest || longest == 0.0);
    range(short.flat_map(|bar| [bar[1], bar[2]]).chain([low, high]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_wild_bars_do_not_spoil_the_scale() {
        let curve = Curve {
            x: vec![3.0, 1.0, 2.0, f64::NAN],
            y: vec![0.3, 0.1, f64::NAN, 1.0],
            y_std_error: vec![0.01, 90.0, 0.01],
            model: vec![0.3, 0.1, 0.2],
            ..Default::default()
        };
        let chart = chart(&curve).unwrap();
        let [_, Layer::Line(line, _), _, Layer::Marks(marks, _)] = &chart.layers[..] else {
            panic!("{:?}", chart.layers)
        };
        assert_eq!(marks.len(), 2);
        assert_eq!(line[..], [[1.0, 0.1], [2.0, 0.2], [3.0, 0.3]]);
        assert!(chart.y.high < 0.4 && chart.y.low <= 0.0);
        assert!(chart.svg().is_ok());
        assert_eq!(super::chart(&Curve::default()), None);
        let unmeasured = Curve { x: vec![1.0, 2.0], model: vec![0.1, 0.2], ..Default::default() };
        assert_eq!(super::chart(&unmeasured), None);
    }
}
