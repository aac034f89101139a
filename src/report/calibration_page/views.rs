//! The views: their numbers in a table, and residual images, which show what numbers cannot.

use maud::{Markup, html};

use crate::error::Result;
use crate::measure::{ReferenceDistance, ViewMeasurement};
use crate::report::axis::Axis;
use crate::report::document::{Column, section, table_of};
use crate::report::numbers::{ABSENT, MM, degrees, fixed, millimetres};
use crate::report::residuals::{residual_image, scale};

pub(super) fn section_of(views: &[ViewMeasurement]) -> Markup {
    let optional = |text: Option<String>| html! { (text.as_deref().unwrap_or(ABSENT)) };
    let mm = |metres: f64| html! { (millimetres(metres)) };
    let columns: [Column<'_, ViewMeasurement>; 18] = [
        ("view", &|v| html! { (v.name) }),
        (">z m", &|v| html! { (fixed(v.z_m, 3)) }),
        (">axis m", &|v| html! { (fixed(v.axis_distance_m, 3)) }),
        (">off reference mm", &|v| optional(v.reference().map(off_reference))),
        (">tilt θ °", &|v| html! { (degrees(v.theta_rad)) }),
        (">azimuth °", &|v| html! { (degrees(v.azimuth_rad)) }),
        (
            ">σ ± s.e. mm",
            &|v| html! { (mm(v.whole.spread.spatial_m)) " ± " (mm(v.whole.std_error_m)) },
        ),
        (">σ px", &|v| optional(v.sigma_px(&v.whole).map(|px| fixed(px, 3)))),
        (">temporal σ mm", &|v| optional(v.whole.spread.temporal_m.map(millimetres))),
        (">normal σ mm", &|v| mm(v.whole.spread.perpendicular_m)),
        (">paper z m", &|v| optional(v.paper.map(|p| fixed(p.z_m, 3)))),
        (">paper θ °", &|v| optional(v.paper.map(|p| degrees(p.theta_rad)))),
        (">paper σ mm", &|v| optional(v.paper.map(|p| millimetres(p.sigma_m)))),
        (">n", &|v| html! { (v.whole.n) }),
        (">n effective", &|v| html! { (fixed(v.whole.n_effective, 0)) }),
        (">corr. px", &|v| html! { (correlation(v)) }),
        (">frames", &|v| html! { (v.frames) }),
        (">pixels left out", &|v| {
            html! { (v.exclusions.invalid) " / " (v.exclusions.off_plane) " / " (v.exclusions.edge) }
        }),
    ];
    let content = html! {
        (table_of(&columns, views))
        p.note {
            "z: mean depth of the target. Axis: depth of its plane on the optical axis. Off reference: that \
             minus the distance measured by other means, “(!)” where they differ by more than "
            (ReferenceDistance::describe_tolerance()) ". σ: of one frame over the whole target, along the optical \
             axis; in px of disparity where the sensor has one. Temporal: of one pixel over the frames. Normal: across the plane. Paper: mean depth, tilt and \
             spread of the RANSAC inliers of the first frame. n: samples (pixels times frames). n effective: \
             independent samples they are worth. Corr.: length over which neighbouring pixels err together; “+” \
             where it had not died out. Pixels left out: without depth / off the plane / at the target's edge."
        }
    };
    section("Views", &content)
}

/// The difference in mm with its sign, marked where it exceeds the tolerance.
fn off_reference(r: ReferenceDistance) -> String {
    let sign = if r.off_m() > 0.0 { "+" } else { "" };
    let mark = if r.contradicts() { " (!)" } else { "" };
    format!("{sign}{}{mark}", fixed(MM * r.off_m(), 1))
}

fn correlation(view: &ViewMeasurement) -> String {
    let length = fixed(view.correlation.sum_of_squares.sqrt(), 1);
    if view.correlation.persists { length + "+" } else { length }
}

pub(super) fn gallery(views: &[ViewMeasurement]) -> Result<Markup> {
    let pictures = views.iter().map(picture).collect::<Result<Vec<Markup>>>()?;
    let content = html! {
        p {
            "Mean depth minus the plane, along the optical axis, in mm. Blue is nearer than the plane, red \
             farther, grey is not the target. Each picture has its own scale; a click enlarges it."
        }
        div.gallery { @for picture in pictures { (picture) } }
    };
    Ok(section("Residuals", &content))
}

fn picture(view: &ViewMeasurement) -> Result<Markup> {
    let (picture, name) = (&view.picture, &view.name);
    let scale = scale(&picture.millimetres);
    let size = [picture.width, picture.height];
    let (z, tilt, end) = (fixed(view.z_m, 2), degrees(view.theta_rad), Axis::label(scale));
    let alt = format!("residual of view {name}, {z} m, tilt {tilt}°: ±{end} mm from blue to red");
    let image = residual_image(size, &picture.millimetres, scale, &alt)?;
    Ok(html! {
        figure {
            (image)
            div.scale { span { "−" (end) } span { "0" } span { "+" (end) " mm" } }
            figcaption {
                b { (name) } br;
                (z) " m, " (tilt) "°, σ " (millimetres(view.whole.spread.spatial_m)) " mm"
            }
        }
    })
}
