//! What a person is to do next.

use maud::{Markup, html};

use super::words::capital;
use crate::diagnose::{Finding, NextView, Status};
use crate::report::numbers::fixed;
use crate::terms::Statistic;

/// Below this slant a board counts as facing the sensor, rad: 3 degrees.
const FACING_RAD: f64 = 0.0524;

/// Nothing where nothing is asked of anybody.
pub(super) fn advice(finding: &Finding) -> Option<Markup> {
    let view = finding.next_view.as_ref().map(view);
    let more = match finding.status {
        Status::Named => None,
        Status::OneOf if view.is_some() => {
            Some("Then diagnose again with this view added to the recording.")
        }
        Status::OneOf => Some(
            "These views do not separate the two. Take views at other distances and slants, and diagnose again.",
        ),
        Status::Unexplained => Some(
            "The simulation can use the measured curve as it is. To learn the cause, change one thing at a time \
             (distance, slant, place in the picture, light, time since switching on) and see what the curve follows.",
        ),
        Status::Recalibrate => Some(
            "Run “kinoise calibrate” on this recording and diagnose again with the new model. No new cause has to \
             be put into the simulation.",
        ),
        Status::NotIdentifiable if view.is_none() && finding.statistic == Statistic::Bias => Some(
            "A flat board looks just as flat with this error as without it. Measure the distance from sensor to board with a tape \
                 for a few views at different distances, write it into each view's view.json as “reference_distance_m”, and \
                 diagnose again.",
        ),
        Status::NotIdentifiable => {
            Some("Add views at other distances and slants, and diagnose again.")
        }
    };
    if view.is_none() && more.is_none() {
        return None;
    }
    Some(html! {
        div.todo {
            p { b { "What to do. " } @if let Some(view) = view { (view) } @if let Some(more) = more { (more) } }
        }
    })
}

/// An instruction to a person holding a board.
fn view(next: &NextView) -> Markup {
    html! {
        "Take one more view: hold the board " b { (fixed(next.z_m, 2)) " m" } " in front of the sensor, "
        @if next.theta_rad.abs() < FACING_RAD { b { "squarely facing it" } ". " }
        @else {
            b { "turned " (fixed(next.theta_rad.to_degrees(), 0)) "°" } " away from facing it, its "
            b { (far_side(next.azimuth_rad)) } " farthest away (as the sensor sees it). "
        }
        @if !next.why.is_empty() { (sentence(&next.why)) " " }
    }
}

/// Depth grows towards the azimuth: 0 to the right, a quarter turn down.
fn far_side(azimuth_rad: f64) -> &'static str {
    const SIDES: [&str; 8] = [
        "right side",
        "lower right corner",
        "lower side",
        "lower left corner",
        "left side",
        "upper left corner",
        "upper side",
        "upper right corner",
    ];
    let eighths = (azimuth_rad / std::f64::consts::FRAC_PI_4).round() as i64;
    SIDES[eighths.rem_euclid(8) as usize]
}

/// With a capital and a full stop.
pub(super) fn sentence(words: &str) -> String {
    let words = capital(words.trim());
    if words.is_empty() || words.ends_with(['.', '!', '?']) { words } else { words + "." }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_far_side_is_named() {
        for (degrees, side) in [
            (0.0, "right side"),
            (92.0, "lower side"),
            (-90.0, "upper side"),
            (180.0, "left side"),
            (-180.0, "left side"),
        ] {
            assert_eq!(far_side(f64::to_radians(degrees)), side);
        }
    }
}
