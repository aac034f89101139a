//! What to do next about a finding.

use maud::{Markup, html};

use super::sentences::sentence;
use crate::capture::far_side;
use crate::diagnose::{Finding, NextView, Status};
use crate::report::numbers::fixed;
use crate::terms::Statistic;

/// Below this tilt a target counts as facing the sensor, rad: 3 degrees.
const FACING_RAD: f64 = 0.0524;

/// Nothing where nothing is asked of anybody.
pub(super) fn advice(finding: &Finding) -> Option<Markup> {
    let view = finding.next_view.as_ref();
    let more = match finding.status {
        Status::Named => "",
        Status::OneOf if view.is_some() => {
            "Then diagnose again with this view added to the recording."
        }
        Status::OneOf => {
            "These views do not separate the alternatives. Add views at other distances and tilts, and diagnose again."
        }
        Status::Unexplained => {
            "The simulation can use the measured curve as it is. To find the cause, change one thing at a time \
             (distance, tilt, place in the picture, light, time since switching on) and see what the curve follows."
        }
        Status::Recalibrate => {
            "Run “kinoise calibrate” on this recording and diagnose again with the new model. No effect has to be \
             added to the simulation."
        }
        Status::NotIdentifiable if view.is_none() && finding.statistic == Statistic::Bias => {
            "A plane with this error still looks like a plane. Measure the distance from sensor to target with a tape \
             in a few views at different distances, write it into each view's view.json as “reference_distance_m”, \
             and diagnose again."
        }
        Status::NotIdentifiable => "Add views at other distances and tilts, and diagnose again.",
    };
    (view.is_some() || !more.is_empty())
        .then(|| html! { @if let Some(view) = view { (next_view(view)) } (more) })
}

/// An instruction to a person holding a target.
fn next_view(next: &NextView) -> Markup {
    let tilt = fixed(next.theta_rad.to_degrees(), 0);
    let far = far_side(next.azimuth_rad);
    let part = if far.contains(' ') { "corner" } else { "side" };
    html! {
        "Take one more view: hold the target " b { (fixed(next.z_m, 2)) " m" } " in front of the sensor, "
        @if next.theta_rad.abs() < FACING_RAD { b { "facing it" } ". " }
        @else { b { "tilted by " (tilt) "°" } ", its " b { (far) " " (part) } " farthest away as the sensor sees it. " }
        @if !next.why.is_empty() { (sentence(&next.why)) " " }
    }
}
