//! The vendors' metrics by distance and by view, and how they differ from kinoise's own.

use maud::{Markup, html};

use super::chart::Chart;
use super::colours::line;
use super::document::{Column, Origin, document, figure, section, table_of};
use super::numbers::{ABSENT, MM, degrees, fixed, millimetres, percent};
use super::trajectories::chart;
use crate::error::Result;
use crate::metrics::{AtDistance, Metrics, ViewMetrics};
use crate::report::chart::Stroke;

/// Renders the page as HTML text.
pub fn metrics_page(title: &str, metrics: &Metrics, origin: &Origin) -> Result<String> {
    let body = html! {
        h1 { (title) }
        (section("By distance", &html! {
            @if metrics.by_distance.len() > 1 { (figure(&over_distance(&metrics.by_distance), "")?) }
            (table_of(&distance_columns(), &metrics.by_distance))
            p.note { "Means over the views that face the sensor within ten degrees; over all, where none does." }
        }))
        (section("By view", &html! { (table_of(&view_columns(), &metrics.views)) (legend()) }))
        (section("Beside kinoise's sigma", &difference()))
        @if !metrics.excluded.is_empty() {
            (section("Views left out", &html! { ul { @for [view, why] in &metrics.excluded {
                li { b { (view) } ": " (why) }
            } } }))
        }
    };
    Ok(document(title, origin, &[], &body).into_string())
}

fn over_distance(groups: &[AtDistance]) -> Chart {
    let of = |value: fn(&AtDistance) -> Option<f64>| {
        let point = |g: &AtDistance| Some([g.mean.axis_distance_m, MM * value(g)?]);
        groups.iter().filter_map(point).collect::<Vec<_>>()
    };
    let fit = of(|g| Some(g.mean.plane_fit_rms_m));
    let temporal = of(|g| Some(g.temporal_noise? * g.mean.axis_distance_m));
    let lines = [("plane-fit RMS", fit, 0), ("temporal noise", temporal, 1)].into_iter();
    let lines = lines.filter(|(_, points, _)| points.len() > 1);
    let lines = lines.map(|(name, points, i)| (name.into(), points, Stroke::new(line(i), 2)));
    let lines = lines.collect();
    chart("Noise over distance", ["distance on the optical axis (m)", "mm"], lines, false)
}

fn optional(text: Option<String>) -> Markup {
    html! { (text.as_deref().unwrap_or(ABSENT)) }
}

/// A percentage with decimals, for small shares.
fn fine(share: f64) -> String {
    format!("{} %", fixed(1e2 * share, 3))
}

fn distance_columns<'a>() -> [Column<'a, AtDistance>; 8] {
    [
        ("distance m", &|g| html! { (fixed(g.range_m[0], 1)) " – " (fixed(g.range_m[1], 1)) }),
        (">views", &|g| html! { (g.views) }),
        (">Z-accuracy", &|g| optional(g.mean.z_accuracy.map(fine))),
        (">plane-fit RMS mm", &|g| html! { (millimetres(g.mean.plane_fit_rms_m)) }),
        (">of the distance", &|g| html! { (fine(g.mean.plane_fit_rms)) }),
        (">sub-pixel RMS px", &|g| optional(g.mean.subpixel_rms_px.map(|px| fixed(px, 3)))),
        (">temporal noise", &|g| optional(g.temporal_noise.map(fine))),
        (">fill rate", &|g| html! { (percent(g.mean.fill_rate)) }),
    ]
}

fn view_columns<'a>() -> [Column<'a, ViewMetrics>; 12] {
    [
        ("view", &|v| html! { (v.view) }),
        (">frames", &|v| html! { (v.frames.len()) }),
        (">distance m", &|v| html! { (fixed(v.mean.axis_distance_m, 3)) }),
        (">reference m", &|v| optional(v.reference_distance_m.map(|m| fixed(m, 3)))),
        (">tilt °", &|v| html! { (degrees(v.mean.tilt_rad)) }),
        (">Z-accuracy", &|v| optional(v.mean.z_accuracy.map(fine))),
        (">plane-fit RMS mm", &|v| html! { (millimetres(v.mean.plane_fit_rms_m)) }),
        (">sub-pixel RMS px", &|v| optional(v.mean.subpixel_rms_px.map(|px| fixed(px, 3)))),
        (">temporal noise", &|v| optional(v.temporal_noise.map(fine))),
        (">fill rate", &|v| html! { (percent(v.mean.fill_rate)) }),
        (">kinoise σ mm", &|v| html! { (millimetres(v.sigma_m)) }),
        (">kinoise temporal σ mm", &|v| optional(v.sigma_temporal_m.map(millimetres))),
    ]
}

fn legend() -> Markup {
    html! { p.note {
        "Means over a view's frames, over the target's pixels. Z-accuracy: median signed error of the depth against \
         the reference distance, the fitted plane turned to face the camera; positive where the sensor sees the \
         target too far away. Plane-fit RMS: root mean square of the pixels' distances from the plane. Sub-pixel RMS: \
         the same in px of disparity. Temporal noise: median over the pixels of a depth's standard deviation over its \
         median. Fill rate: pixels with a depth."
    } }
}

fn difference() -> Markup {
    html! { p {
        "These are the formulas of RealSense's Depth Quality Tool. Its plane is fitted to all points of a frame, gross \
         errors and bent corners with them. It leaves out the half percent of nearest and of farthest points, which on a \
         tilted target are its ends and not its errors. Its RMS is taken across the plane and holds all that bends \
         the depth; kinoise's σ is along the optical axis, robust against gross errors, and has a standard error. Its \
         temporal noise is a share of the depth and zero for a pixel whose rounded depth never changed."
    } }
}
