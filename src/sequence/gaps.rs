//! What the stamps of a film say about its recording.

use super::Moment;
use crate::stats::median;

/// A frame this many usual intervals after the one before it: frames are missing between them.
const GAP: f64 = 3.5;

/// Depth images without a partner of their own time, told.
pub(super) fn remarks(moments: &[Moment]) -> Option<String> {
    let intervals: Vec<f64> = moments.windows(2).map(|w| w[1].stamp - w[0].stamp).collect();
    let usual = median(&mut intervals.clone());
    let gaps: Vec<usize> = (0..intervals.len()).filter(|&i| intervals[i] > GAP * usual).collect();
    let longest = gaps.iter().copied().max_by(|&a, &b| intervals[a].total_cmp(&intervals[b]))?;
    Some(format!(
        "{} gaps in the depth stamps, the longest {:.2} s after {:.6} (usual interval {:.1} ms)",
        gaps.len(),
        intervals[longest],
        moments[longest].stamp,
        1e3 * usual
    ))
}

/// Of moments with one stamp the first is kept; how many were left out.
pub(super) fn keep_first_of_each_stamp(moments: &mut Vec<Moment>) -> Option<String> {
    let before = moments.len();
    moments.dedup_by(|b, a| a.stamp == b.stamp);
    let dropped = before - moments.len();
    (dropped > 0).then(|| {
        format!("{dropped} depth images have the stamp of the one before; only the first is mapped")
    })
}
