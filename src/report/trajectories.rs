//! Trajectories against ground truth: paths, errors over time and error statistics, for every page with them.

use maud::{Markup, html};
use nalgebra::Vector3;

use super::axis::Axis;
use super::chart::{Chart, Entry, Layer, Sample, Stroke};
use super::colours::{ACCENT, INK, line};
use super::document::{Origin, beside, document, figure, list, prose, section, table, tiles};
use super::numbers::{MM, decimals_for, fixed};
use crate::error::Result;
use crate::evaluate::{Delta, Evaluation, Spread};
use crate::stats::range;
use crate::trajectory::Pose;
use crate::units::counted;

/// Room around the lines, share of their extent.
const MARGIN: f64 = 0.04;
/// Most tips along a line.
const MAX_TIPS: usize = 150;

/// Name, points and stroke of a line.
pub(super) type Line = (String, Vec<[f64; 2]>, Stroke);

/// A line chart; `equal` gives both axes the same scale, for two lengths in a plane.
pub(super) fn chart(title: &str, labels: [&str; 2], lines: Vec<Line>, equal: bool) -> Chart {
    let extent = |k: usize| {
        let [low, high] = range(lines.iter().flat_map(|(_, points, _)| points).map(|p| p[k]));
        if low <= high { [low, high] } else { [0.0, 1.0] }
    };
    let extents = [extent(0), extent(1)];
    let extents = if equal { Chart::equal_units(extents) } else { extents };
    let mut chart = Chart::new(title, extents.map(|e| Axis::with_margin(e, MARGIN)), labels);
    let several = lines.len() > 1;
    for (name, points, stroke) in lines {
        let every = points.len().div_ceil(MAX_TIPS).max(1);
        let tip = |[x, y]: &[f64; 2]| {
            let [x_text, y_text] = [x, y].map(|v| fixed(*v, decimals_for(v.abs())));
            ([*x, *y], format!("{name}: {} {x_text}, {} {y_text}", labels[0], labels[1]))
        };
        chart.tips.extend(points.iter().step_by(every).map(tip));
        if several {
            chart.legend.push(Entry::new([Sample::Line(stroke)], name));
        }
        chart.layers.push(Layer::Line(points, stroke));
    }
    chart
}

/// An estimate against ground truth.
#[derive(Debug, Clone, Copy)]
pub struct Against<'a> {
    pub truth: &'a [Pose],
    pub estimate: &'a [Pose],
    pub evaluation: &'a Evaluation,
    /// Interval of the relative error.
    pub delta: Delta,
}

const AXES: [&str; 3] = ["x (m)", "y (m)", "z (m)"];

/// The two axes along which a path is longest, in order.
fn longest_axes(path: &[Vector3<f64>]) -> [usize; 2] {
    let length = |k: usize| {
        let [low, high] = range(path.iter().map(|p| p[k]));
        high - low
    };
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| length(*b).total_cmp(&length(*a)));
    axes[..2].sort_unstable();
    [axes[0], axes[1]]
}

/// Name, poses in time order, evaluation and stroke of an estimated path.
pub(super) type Estimate<'a> = (String, &'a [Pose], &'a Evaluation, Stroke);

/// The true path while any estimate lasts, and the estimates aligned to it, in the plane of the two longest
/// axes of the true path.
pub(super) fn paths(title: &str, truth: &[Pose], estimates: &[Estimate<'_>]) -> Chart {
    let spans: Vec<[f64; 2]> =
        estimates.iter().map(|(_, poses, ..)| range(poses.iter().map(|p| p.stamp))).collect();
    let within = |p: &&Pose| spans.iter().any(|[from, to]| (*from..=*to).contains(&p.stamp));
    let place = |p: &Pose| p.world_from_camera.translation.vector;
    let truth: Vec<Vector3<f64>> = truth.iter().filter(within).map(place).collect();
    let [i, j] = longest_axes(&truth);
    let flat = |p: Vector3<f64>| [p[i], p[j]];
    let truth = truth.into_iter().map(flat).collect();
    let mut lines = vec![("ground truth".into(), truth, Stroke::new(INK, 1))];
    lines.extend(estimates.iter().map(|(name, poses, evaluation, stroke)| {
        let aligned = evaluation.ate.truth_from_estimate;
        let place = |p: &Pose| flat((aligned * p.world_from_camera).translation.vector);
        (name.clone(), poses.iter().map(place).collect(), *stroke)
    }));
    chart(title, [AXES[i], AXES[j]], lines, true)
}

impl Against<'_> {
    /// The paths and both errors over time, each with its file name.
    pub fn charts(&self) -> [(&'static str, Chart); 3] {
        let e = self.evaluation;
        let rpe = format!("Relative pose error over {}", self.delta);
        let over_time = |title: &str, each: &[(f64, f64)], colour| {
            let begin = self.estimate.first().map_or(0.0, |p| p.stamp);
            let errors = each.iter().map(|(t, error)| [t - begin, MM * error]).collect();
            let lines = vec![("error".to_string(), errors, Stroke::new(colour, 2))];
            let mut chart = chart(title, ["time (s)", "error (mm)"], lines, false);
            chart.y = Axis::linear(0.0, chart.y.high);
            chart
        };
        let stroke = Stroke::new(ACCENT, 2);
        let estimate: Estimate<'_> = ("estimate, aligned".into(), self.estimate, e, stroke);
        [
            ("paths.svg", paths("Paths", self.truth, &[estimate])),
            ("ate.svg", over_time("Absolute trajectory error", &e.ate.each, line(0))),
            ("rpe.svg", over_time(&rpe, &e.rpe.each, line(1))),
        ]
    }

    /// Error statistics as tiles and as a table, errors over time, and paths.
    pub(super) fn parts(&self) -> Result<Markup> {
        let e = self.evaluation;
        let row = |name: String, s: Spread| -> Vec<Markup> {
            let figures = s.figures().map(|(_, v)| html! { (fixed(v, 3)) });
            [html! { (name) }].into_iter().chain(figures).chain([html! { (s.pairs) }]).collect()
        };
        let over = self.delta;
        let degrees = e.rpe.rotation.scaled(1f64.to_degrees());
        let rows = [
            row("ATE after alignment, mm".into(), e.ate.error.scaled(MM)),
            row(format!("RPE over {over}, mm"), e.rpe.translation.scaled(MM)),
            row(format!("RPE over {over}, degrees"), degrees),
        ];
        let columns = ["", ">rmse", ">mean", ">median", ">std", ">min", ">max", ">pairs"];
        let mm = |s: &Spread| format!("{} mm", fixed(MM * s.rmse, 1));
        let remark = |s: &Spread| format!("rmse of {}", counted(s.pairs, "pair"));
        let (turn, over) = (format!("{}°", fixed(degrees.rmse, 2)), format!("rmse over {over}"));
        let tiled = [
            ("absolute trajectory error", mm(&e.ate.error), remark(&e.ate.error)),
            ("relative error, translation", mm(&e.rpe.translation), over.clone()),
            ("relative error, rotation", turn, over),
        ];
        let [paths, over_time @ ..] = self.charts().map(|(_, chart)| chart);
        let paths = figure(&paths, "both paths, seen along the axis of least motion")?;
        Ok(html! {
            (tiles(tiled))
            (section("Errors", &html! {
                (table(&columns, rows))
                p.note {
                    "Computed as the scripts of the TUM RGB-D benchmark do. ATE: distance of positions after the best \
                     rigid alignment. RPE: difference of motions over the interval."
                }
                @if !self.evaluation.remarks.is_empty() {
                    (list(self.evaluation.remarks.iter().map(|remark| prose(remark))))
                }
            }))
            (section("Over time", &beside(&over_time)?))
            (section("Both paths", &paths))
        })
    }
}

/// Renders the page of an evaluation as HTML text.
pub fn evaluation_page(against: &Against<'_>, origin: &Origin) -> Result<String> {
    let title = "A trajectory against the ground truth";
    let body = html! {
        h1 { (title) }
        p.sub { (against.estimate.len()) " estimated poses, " (against.truth.len()) " true ones" }
        (against.parts()?)
    };
    Ok(document(title, origin, &[], &body).into_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::evaluate;
    use nalgebra::Isometry3;

    #[test]
    fn the_page_has_both_errors_with_their_units() {
        let poses = |bend: f64| -> Vec<Pose> {
            let pose = |k: i32| {
                let t = f64::from(k) / 10.0;
                let at = [t, 0.0, 0.5 * t + bend * t * t];
                Pose { stamp: t, world_from_camera: Isometry3::translation(at[0], at[1], at[2]) }
            };
            (0..30).map(pose).collect()
        };
        let (truth, estimate) = (poses(0.0), poses(0.01));
        let delta = Delta::Seconds(1.0);
        let evaluation = evaluate(&truth, &estimate, delta).unwrap();
        let against =
            Against { truth: &truth, estimate: &estimate, evaluation: &evaluation, delta };
        let page = evaluation_page(&against, &Origin::default()).unwrap();
        let rmse = fixed(MM * evaluation.ate.error.rmse, 3);
        for says in
            ["RPE over 1 s, degrees", "Relative pose error over 1 s", "x (m)", "z (m)", &rmse]
        {
            assert!(page.contains(says), "{says}");
        }
        assert!(!page.contains("y (m)"), "nothing moved along y");
    }
}
