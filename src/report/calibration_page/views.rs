//! Every view: its numbers in a table, and its residual, which shows what a number cannot.

use maud::{Markup, html};

use crate::error::Result;
use crate::measure::{ReferenceDistance, ViewMeasurement};
use crate::report::axis::Axis;
use crate::report::document::{row, table};
use crate::report::numbers::{ABSENT, MM, degrees, fixed, millimetres};
use crate::report::residuals::{residual_image, scale};

const COLUMNS: [&str; 17] = [
    "view",
    ">z m",
    ">axis m",
    ">off reference mm",
    ">θ °",
    ">azimuth °",
    ">σ ± s.e. mm",
    ">temporal σ mm",
    ">normal σ mm",
    ">paper z m",
    ">paper θ °",
    ">paper σ mm",
    ">n",
    ">n effective",
    ">corr. px",
    ">frames",
    ">pixels left out",
];

pub(super) fn table_of(views: &[ViewMeasurement]) -> Markup {
    html! {
        section {
            h2 { "Views" }
            (table(&COLUMNS, views.iter().map(cells)))
            p.note {
                "z: mean depth of the target. Axis: depth of its plane on the optical axis. Off reference: that \
                 minus the distance measured by other means, “(!)” where they differ by more than "
                (ReferenceDistance::describe_tolerance()) ". σ: of one frame over the whole target, along the optical \
                 axis. Temporal: of one pixel over the frames. Normal: across the plane. Paper: mean depth, tilt and \
                 spread of the RANSAC inliers of the first frame. n: samples (pixels times frames). n effective: \
                 independent samples they are worth. Corr.: length over which neighbouring pixels err together; “+” \
                 where it had not died out. Pixels left out: without depth / off the plane / at the target's edge."
            }
        }
    }
}

fn cells(view: &ViewMeasurement) -> Vec<Markup> {
    let (whole, spread) = (&view.whole, view.whole.spread);
    let paper = |f: &dyn Fn(&_) -> String| view.paper.as_ref().map_or(ABSENT.into(), f);
    let out = view.exclusions;
    row![
        view.name,
        fixed(view.z_m, 3),
        fixed(view.axis_distance_m, 3),
        view.reference().map_or(ABSENT.into(), off_reference),
        degrees(view.theta_rad),
        degrees(view.azimuth_rad),
        format!("{} ± {}", millimetres(spread.spatial_m), millimetres(whole.std_error_m)),
        spread.temporal_m.map_or(ABSENT.into(), millimetres),
        millimetres(spread.perpendicular_m),
        paper(&|p| fixed(p.z_m, 3)),
        paper(&|p| degrees(p.theta_rad)),
        paper(&|p| millimetres(p.sigma_m)),
        whole.n,
        fixed(whole.n_effective, 0),
        correlation(view),
        view.frames,
        format!("{} / {} / {}", out.invalid, out.off_plane, out.edge),
    ]
}

/// Signed, in mm, and marked where it is too much.
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
    Ok(html! {
        section {
            h2 { "Residuals" }
            p {
                "Mean depth minus the plane, along the optical axis. Blue is nearer than the plane, red farther, \
                 grey is not the target. Each picture has its own scale."
            }
            div.gallery { @for picture in pictures { (picture) } }
        }
    })
}

fn picture(view: &ViewMeasurement) -> Result<Markup> {
    let picture = &view.picture;
    let scale = scale(&picture.millimetres);
    let size = [picture.width, picture.height];
    let alt = format!("residual of view {}", view.name);
    let image = residual_image(size, &picture.millimetres, scale, &alt)?;
    let end = Axis::label(scale);
    Ok(html! {
        figure {
            (image)
            div.scale { span { "−" (end) } span { "0" } span { "+" (end) " mm" } }
            figcaption {
                b { (view.name) } br;
                (fixed(view.z_m, 2)) " m, " (degrees(view.theta_rad)) "°, σ "
                (millimetres(view.whole.spread.spatial_m)) " mm"
            }
        }
    })
}
