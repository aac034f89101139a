//! Figures 6 to 8 and the page of a comparison.

use maud::html;
use nalgebra::Vector3;

use super::axis::Axis;
use super::chart::{Chart, Entry, Layer, Sample, Stroke};
use super::colours::{self, INK};
use super::document::{document, figure, list};
use super::numbers::MM;
use crate::compare::{Comparison, Row, Run, tables};
use crate::error::Result;
use crate::stats::range;
use crate::trajectory::Pose;

/// Room around the lines, share of their extent.
const MARGIN: f64 = 0.04;

/// Its name, its points, and how it is drawn.
type Line = (String, Vec<[f64; 2]>, Stroke);

/// Fig. 6 (paths from above), Fig. 7 (ATE over time) and Fig. 8 (RPE over time), by file name.
///
/// # Errors
/// When plotters fails.
pub fn comparison_figures(comparison: &Comparison) -> Result<Vec<(&'static str, String)>> {
    charts(comparison).into_iter().map(|(name, chart)| Ok((name, chart.svg()?))).collect()
}

/// The page: tables and figures, one self-contained file.
///
/// # Errors
/// When plotters fails.
pub fn comparison_page(comparison: &Comparison) -> Result<String> {
    let figures = charts(comparison).into_iter().map(|(_, chart)| figure(&chart, &chart.title));
    let figures = figures.collect::<Result<Vec<_>>>()?;
    let body = html! {
        h1 { "Mapping " (comparison.sequence) ", variant by variant" }
        p { "The first four rows are the paper's variants with the parameters of its Table II; those below \
            go past it, one step at a time. Errors are computed as the scripts of the TUM benchmark do." }
        div.wide { pre { (tables::text(comparison)) } }
        @for figure in figures { (figure) }
        @if !comparison.remarks.is_empty() { h2 { "Notes" } }
        (list(comparison.remarks.iter().map(|remark| html! { (remark) })))
    };
    let title = format!("Mapping {}", comparison.sequence);
    Ok(document(&title, None, &body).into_string())
}

fn charts(comparison: &Comparison) -> [(&'static str, Chart); 3] {
    let ate = "Fig. 7. Absolute trajectory error";
    let rpe = "Fig. 8. Relative pose error over 1 s";
    [
        ("fig6_paths.svg", paths(comparison)),
        ("fig7_ate.svg", over_time(comparison, ate, |r| &r.evaluation.ate.each)),
        ("fig8_rpe.svg", over_time(comparison, rpe, |r| &r.evaluation.rpe.each)),
    ]
}

/// `equal` when both axes are lengths of one plane.
fn chart(title: &str, labels: [&str; 2], lines: Vec<Line>, equal: bool) -> Chart {
    let extent = |k: usize| {
        let [low, high] = range(lines.iter().flat_map(|(_, points, _)| points).map(|p| p[k]));
        if low <= high { [low, high] } else { [0.0, 1.0] }
    };
    let extents = [extent(0), extent(1)];
    let extents = if equal { Chart::equal_units(extents) } else { extents };
    let mut chart = Chart::new(title, extents.map(|e| Axis::with_margin(e, MARGIN)), labels);
    for (name, points, stroke) in lines {
        chart.legend.push(Entry::new([Sample::Line(stroke)], name));
        chart.layers.push(Layer::Line(points, stroke));
    }
    chart
}

/// The variants that are drawn, each in its colour: the paper's, and the last way past it.
fn lines(comparison: &Comparison, points: impl Fn(&Run) -> Vec<[f64; 2]>) -> Vec<Line> {
    let line = |(i, (row, run)): (usize, (&Row, &Run))| {
        (row.variant.name.into(), points(run), Stroke::new(colours::line(i), 2))
    };
    drawn(comparison).enumerate().map(line).collect()
}

fn drawn(comparison: &Comparison) -> impl Iterator<Item = (&Row, &Run)> {
    let default = comparison.rows.iter().filter(|r| r.variant.name.contains("default"));
    let paper = comparison.rows.iter().filter(|r| r.variant.of_the_paper);
    paper.chain(default).filter_map(|row| Some((row, row.runs.first()?)))
}

fn paths(comparison: &Comparison) -> Chart {
    let within = |stamp: f64| {
        drawn(comparison).any(|(_, run)| {
            let (first, last) = (run.trajectory.first(), run.trajectory.last());
            first.is_some_and(|p| p.stamp <= stamp) && last.is_some_and(|p| p.stamp >= stamp)
        })
    };
    let from_above = |p: &Vector3<f64>| [p.x, p.y];
    let truth = comparison.truth.iter().filter(|p| within(p.stamp));
    let truth = truth.map(|p| from_above(&p.world_from_camera.translation.vector)).collect();
    let mut paths = vec![("ground truth".into(), truth, Stroke::new(INK, 1))];
    paths.extend(lines(comparison, |run| {
        let aligned = run.evaluation.ate.truth_from_estimate;
        let place = |p: &Pose| from_above(&(aligned * p.world_from_camera).translation.vector);
        run.trajectory.iter().map(place).collect()
    }));
    chart("Fig. 6. Paths from above, aligned", ["x (m)", "y (m)"], paths, true)
}

fn over_time(comparison: &Comparison, title: &str, of: fn(&Run) -> &Vec<(f64, f64)>) -> Chart {
    let begin = comparison.rows.iter().flat_map(|r| &r.runs).flat_map(|r| r.trajectory.first());
    let begin = begin.map(|p| p.stamp).fold(f64::INFINITY, f64::min);
    let errors = |run: &Run| of(run).iter().map(|(t, e)| [t - begin, MM * e]).collect();
    chart(title, ["time (s)", "error (mm)"], lines(comparison, errors), false)
}
