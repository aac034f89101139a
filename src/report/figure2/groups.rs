//! Which points share a colour.

use crate::measure::SigmaRow;
use crate::model::DISTANCE_RATIO;

/// More colours and shapes than this cannot be told apart.
pub(super) const MAX_GROUPS: usize = 7;
/// Distances within a group differ by less than this: sigma ~ z^2 then by less than half.
const WIDEST_RATIO: f64 = 1.25;

/// Rows by distance, nearest group first, sorted inside; none of the groups is empty.
///
/// Where the distances leave gaps the groups are those of the recording; where they run on,
/// they are cut into equal ratios (not equal counts, which would put equal distances apart).
pub(super) fn by_distance(rows: &[SigmaRow]) -> Vec<Vec<SigmaRow>> {
    let mut sorted = rows.to_vec();
    sorted.sort_by(|a, b| a.z_m.total_cmp(&b.z_m));
    let natural: Vec<Vec<SigmaRow>> =
        sorted.chunk_by(|a, b| b.z_m <= a.z_m * DISTANCE_RATIO).map(<[SigmaRow]>::to_vec).collect();
    let compact = |g: &Vec<SigmaRow>| g[g.len() - 1].z_m < WIDEST_RATIO * g[0].z_m;
    if natural.len() <= MAX_GROUPS && natural.iter().all(compact) {
        natural
    } else {
        equal_ratios(&sorted)
    }
}

fn equal_ratios(sorted: &[SigmaRow]) -> Vec<Vec<SigmaRow>> {
    let [low, high] = [sorted[0].z_m, sorted[sorted.len() - 1].z_m];
    let range = (high / low).ln();
    let count = (range / WIDEST_RATIO.ln()).ceil().clamp(1.0, MAX_GROUPS as f64);
    let bin = |r: &SigmaRow| ((r.z_m / low).ln() / range * count).min(count - 1.0) as usize;
    sorted.chunk_by(|a, b| bin(a) == bin(b)).map(<[SigmaRow]>::to_vec).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(distances: impl IntoIterator<Item = f64>) -> Vec<SigmaRow> {
        let row =
            |z_m| SigmaRow { z_m, theta_rad: 0.0, sigma_m: 0.001, n_effective: None, view: 0 };
        distances.into_iter().map(row).collect()
    }

    fn sizes(rows: &[SigmaRow]) -> Vec<usize> {
        by_distance(rows).iter().map(Vec::len).collect()
    }

    #[test]
    fn gaps_make_groups() {
        assert_eq!(sizes(&rows([2.0, 1.0, 1.01, 2.02, 3.0, 1.0])), [3, 2, 1]);
        assert_eq!(sizes(&rows([1.0])), [1]);
        assert!(by_distance(&[]).is_empty());
    }

    #[test]
    fn a_continuous_range_is_cut_into_seven_at_most() {
        let many = rows((0..400).map(|i| 0.5 + 0.01 * f64::from(i)));
        let groups = by_distance(&many);
        assert!(groups.len() <= MAX_GROUPS);
        assert_eq!(groups.iter().map(Vec::len).sum::<usize>(), 400);
        assert!(groups.windows(2).all(|w| w[0][w[0].len() - 1].z_m < w[1][0].z_m));
    }

    #[test]
    fn many_separate_distances_are_put_together() {
        let groups = by_distance(&rows((1..=20).map(|i| 0.5 * f64::from(i))));
        assert!((3..=MAX_GROUPS).contains(&groups.len()));
    }
}
