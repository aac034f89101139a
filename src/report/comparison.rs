//! Figures 6 to 8 and the page of a comparison of mapping variants.

use maud::{Markup, html};

use super::chart::{Chart, Stroke};
use super::colours;
use super::document::{Origin, beside, document, figure, list, prose, section, table};
use super::numbers::{ABSENT, MM, fixed};
use super::trajectories::{self, Estimate, Line, chart};
use crate::compare::{Comparison, Row, Run, tables};
use crate::error::Result;

/// Renders the page, one self-contained file with tables and figures.
pub fn comparison_page(comparison: &Comparison, origin: &Origin) -> Result<String> {
    let [paths, over_time @ ..] = comparison_charts(comparison).map(|(_, chart)| chart);
    let title = format!("Mapping {}, variant by variant", comparison.sequence);
    let body = html! {
        h1 { (title) }
        p { "The first four rows are the paper's variants with the parameters of its Table II; those below \
            go past it, one step at a time. Errors are computed as the scripts of the TUM benchmark do." }
        (section("Figures", &html! { (figure(&paths, "")?) (beside(&over_time)?) }))
        @for part in tables::tables(comparison) { (section(part.title, &table_of(&part))) }
        @if !comparison.remarks.is_empty() {
            (section("Notes", &list(comparison.remarks.iter().map(|remark| prose(remark)))))
        }
    };
    Ok(document(&title, origin, &[], &body).into_string())
}

fn table_of(part: &tables::Table) -> Markup {
    let titles = part.columns.iter().map(|(title, _)| format!(">{title}"));
    let mut titles: Vec<String> = std::iter::once("variant".into()).chain(titles).collect();
    let remarks = part.rows.iter().any(|row| !row.remark.is_empty());
    titles.extend(remarks.then(|| "~remark".to_string()));
    let cells = |row: &tables::TableRow| {
        let figure = |(i, (_, decimals)): (usize, &(_, usize))| {
            row.figures.get(i).map_or(ABSENT.into(), |v| fixed(*v, *decimals))
        };
        let figures = part.columns.iter().enumerate().map(figure).map(|text| html! { (text) });
        let remark = remarks.then(|| prose(row.remark.trim()));
        [html! { (row.name) }].into_iter().chain(figures).chain(remark).collect()
    };
    table(&titles, part.rows.iter().map(cells))
}

/// Fig. 6 (paths from above), Fig. 7 (ATE over time) and Fig. 8 (RPE over time), by file name.
pub fn comparison_charts(comparison: &Comparison) -> [(&'static str, Chart); 3] {
    let ate = "Fig. 7. Absolute trajectory error";
    let rpe = "Fig. 8. Relative pose error over 1 s";
    [
        ("fig6_paths.svg", paths(comparison)),
        ("fig7_ate.svg", over_time(comparison, ate, |r| &r.evaluation.ate.each)),
        ("fig8_rpe.svg", over_time(comparison, rpe, |r| &r.evaluation.rpe.each)),
    ]
}

/// Lines of the drawn variants, each in its colour: the paper's, then the default.
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
    let estimates = drawn(comparison).enumerate().map(|(i, (row, run))| -> Estimate<'_> {
        let stroke = Stroke::new(colours::line(i), 2);
        (row.variant.name.into(), &run.trajectory, &run.evaluation, stroke)
    });
    let estimates: Vec<Estimate<'_>> = estimates.collect();
    trajectories::paths("Fig. 6. Paths, aligned", &comparison.truth, &estimates)
}

fn over_time(comparison: &Comparison, title: &str, of: fn(&Run) -> &Vec<(f64, f64)>) -> Chart {
    let begin = comparison.rows.iter().flat_map(|r| &r.runs).flat_map(|r| r.trajectory.first());
    let begin = begin.map(|p| p.stamp).fold(f64::INFINITY, f64::min);
    let errors = |run: &Run| of(run).iter().map(|(t, e)| [t - begin, MM * e]).collect();
    chart(title, ["time (s)", "error (mm)"], lines(comparison, errors), false)
}
