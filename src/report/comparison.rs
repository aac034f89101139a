//! Figures 6 to 8 and the page of a comparison.

use maud::{PreEscaped, html};

use super::document::document;
use super::lines::{Line, LineFigure};
use crate::compare::{Comparison, Row, Run, tables};
use crate::error::Result;

/// Fig. 6 (paths from above), Fig. 7 (ATE over time) and Fig. 8 (RPE over time), by file name.
///
/// # Errors
/// When plotters fails.
pub fn comparison_figures(comparison: &Comparison) -> Result<Vec<(&'static str, String)>> {
    let figures = [
        ("fig6_paths.svg", paths(comparison)),
        (
            "fig7_ate.svg",
            over_time(comparison, "Fig. 7. Absolute trajectory error", |r| &r.evaluation.ate.each),
        ),
        (
            "fig8_rpe.svg",
            over_time(comparison, "Fig. 8. Relative pose error over 1 s", |r| {
                &r.evaluation.rpe.each
            }),
        ),
    ];
    figures.into_iter().map(|(name, figure)| Ok((name, figure.svg()?))).collect()
}

/// The page: tables and figures, one self-contained file.
///
/// # Errors
/// When plotters fails.
pub fn comparison_page(comparison: &Comparison) -> Result<String> {
    let figures = comparison_figures(comparison)?;
    let body = html! {
        h1 { "Mapping " (comparison.sequence) ", variant by variant" }
        p { "The first four rows are the paper's variants with the parameters of its Table II; those below \
            go past it, one step at a time. Errors are computed as the scripts of the TUM benchmark do." }
        div.wide { pre { (tables::text(comparison)) } }
        @for (_, svg) in &figures { figure { div.wide { (PreEscaped(svg)) } } }
        @if !comparison.remarks.is_empty() {
            h2 { "Notes" }
            ul { @for remark in &comparison.remarks { li { (remark) } } }
        }
    };
    let title = format!("Mapping {}", comparison.sequence);
    Ok(document(&title, None, &body).into_string())
}

/// The rows that are drawn: the paper's, and the last way past it.
fn drawn(comparison: &Comparison) -> impl Iterator<Item = (&Row, &Run)> {
    let default = comparison.rows.iter().filter(|r| r.variant.name.contains("default"));
    let paper = comparison.rows.iter().filter(|r| r.variant.of_the_paper);
    paper.chain(default).filter_map(|row| Some((row, row.runs.first()?)))
}

fn paths(comparison: &Comparison) -> LineFigure {
    let within = |stamp: f64| {
        drawn(comparison).any(|(_, run)| {
            let (first, last) = (run.trajectory.first(), run.trajectory.last());
            first.is_some_and(|p| p.stamp <= stamp) && last.is_some_and(|p| p.stamp >= stamp)
        })
    };
    let level = |p: nalgebra::Vector3<f64>| [p.x, p.y];
    let truth = comparison.truth.iter().filter(|p| within(p.stamp));
    let mut lines = vec![Line {
        name: "ground truth".into(),
        points: truth.map(|p| level(p.world_from_camera.translation.vector)).collect(),
        is_truth: true,
    }];
    lines.extend(drawn(comparison).map(|(row, run)| {
        let aligned = run.evaluation.ate.truth_from_estimate;
        let place =
            |p: &crate::trajectory::Pose| level((aligned * p.world_from_camera).translation.vector);
        Line {
            name: row.variant.name.into(),
            points: run.trajectory.iter().map(place).collect(),
            is_truth: false,
        }
    }));
    LineFigure::new("Fig. 6. Paths from above, aligned", ["x (m)", "y (m)"], lines, true)
}

fn over_time(
    comparison: &Comparison,
    title: &str,
    of: impl Fn(&Run) -> &Vec<(f64, f64)>,
) -> LineFigure {
    let begin = comparison.rows.iter().flat_map(|r| &r.runs).flat_map(|r| r.trajectory.first());
    let begin = begin.map(|p| p.stamp).fold(f64::INFINITY, f64::min);
    let lines = drawn(comparison)
        .map(|(row, run)| Line {
            name: row.variant.name.into(),
            points: of(run).iter().map(|(t, e)| [t - begin, 1e3 * e]).collect(),
            is_truth: false,
        })
        .collect();
    LineFigure::new(title, ["time (s)", "error (mm)"], lines, false)
}
