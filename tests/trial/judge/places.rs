//! Whether a finding is in the right place: its axis and its stretch of it.

use crate::raytraced::question::Hidden;
use crate::verdict::Said;

/// Words for one axis: disparity is focal length times baseline over distance.
const SAME: [&[&str]; 1] = [&["z", "disparity", "range"]];

fn same_axis(a: &str, b: &str) -> bool {
    a == b || SAME.iter().any(|words| words.contains(&a) && words.contains(&b))
}

/// On the axis of the label, or on one on which it shows as well.
pub fn right_axis(said: &Said, hidden: &Hidden) -> bool {
    same_axis(&said.axis, &hidden.axis) || hidden.also.iter().any(|a| same_axis(&said.axis, a))
}

/// Nothing is known by name, but what kind of thing it is and what it depends on.
pub fn right_place(said: &Said, hidden: &Hidden) -> bool {
    said.statistic == hidden.statistic && right_axis(said, hidden)
}

/// What both stretches share over what either holds; `None` where there is nothing to compare.
pub fn overlap(said: &Said, hidden: &Hidden) -> Option<f64> {
    let truth = hidden.interval.filter(|_| said.axis == hidden.axis)?;
    let [Some(low), Some(high)] = said.interval else { return None };
    let shared = high.min(truth[1]) - low.max(truth[0]);
    let either = high.max(truth[1]) - low.min(truth[0]);
    if either > 0.0 { Some(shared.max(0.0) / either) } else { None }
}
