//! The table of views.

use maud::{Markup, html};

use crate::measure::{ReferenceDistance, ViewMeasurement};
use crate::report::numbers::{ABSENT, MM, degrees, fixed, millimetres};

const COLUMNS: [&str; 16] = [
    "z m",
    "axis m",
    "off reference mm",
    "θ °",
    "azimuth °",
    "σ ± s.e. mm",
    "temporal σ mm",
    "perp. σ mm",
    "paper z m",
    "paper θ °",
    "paper σ mm",
    "n",
    "n effective",
    "corr. px",
    "frames",
    "pixels left out",
];

pub(super) fn section(views: &[ViewMeasurement]) -> Markup {
    html! {
        section {
            h2 { "Views" }
            div.wide { table.small {
                thead { tr { th { "view" } @for name in COLUMNS { th.n { (name) } } } }
                tbody { @for view in views { (row(view)) } }
            } }
            p.note {
                "z: mean depth of the target. Axis: depth of its plane on the optical axis; off reference: that less \
                 the distance measured by other means, “(!)” where they differ by more than "
                (ReferenceDistance::describe_tolerance()) ". σ: of one frame over the whole target, along the optical axis. Temporal: of one pixel over the frames. \
                 Perp.: across the plane. Paper: mean depth, tilt and spread of the RANSAC inliers of the first \
                 frame. n: samples (pixels times frames); n effective: independent samples they are worth. Corr.: \
                 length within which neighbouring pixels err together; “+” where it had not died out. Pixels left \
                 out: without depth / off the plane / at the target's edge."
            }
        }
    }
}

fn row(view: &ViewMeasurement) -> Markup {
    let paper = view.paper.as_ref();
    let spread = view.whole.spread;
    let absent = || ABSENT.to_string();
    let cells = [
        fixed(view.z_m, 3),
        fixed(view.axis_distance_m, 3),
        view.reference().map_or_else(absent, off_reference),
        degrees(view.theta_rad),
        degrees(view.azimuth_rad),
        format!("{} ± {}", millimetres(spread.spatial_m), millimetres(view.whole.std_error_m)),
        spread.temporal_m.map_or_else(absent, millimetres),
        millimetres(spread.perpendicular_m),
        paper.map_or_else(absent, |p| fixed(p.z_m, 3)),
        paper.map_or_else(absent, |p| degrees(p.theta_rad)),
        paper.map_or_else(absent, |p| millimetres(p.sigma_m)),
        view.whole.n.to_string(),
        fixed(view.whole.n_effective, 0),
        correlation(view),
        view.frames.to_string(),
        left_out(view),
    ];
    html! {
        tr { th { (view.name) } @for cell in cells { td.n { (cell) } } }
    }
}

/// Signed, in mm, and marked where it is too much.
fn off_reference(r: ReferenceDistance) -> String {
    let off = fixed(MM * r.off_m(), 1);
    let sign = if r.off_m() > 0.0 { "+" } else { "" };
    let mark = if r.contradicts() { " (!)" } else { "" };
    format!("{sign}{off}{mark}")
}

fn correlation(view: &ViewMeasurement) -> String {
    let length = fixed(view.correlation.sum_of_squares.sqrt(), 1);
    if view.correlation.persists { length + "+" } else { length }
}

fn left_out(view: &ViewMeasurement) -> String {
    let e = view.exclusions;
    format!("{} / {} / {}", e.invalid, e.off_plane, e.edge)
}
