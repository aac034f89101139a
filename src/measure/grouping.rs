//! Groups the target's pixels by depth, and finds the quantisation step and the robust scale of a cell.

use super::Workbench;
use super::cells::Bins;
use crate::frame::DepthTable;
use crate::plane::{MAD_TO_SIGMA, Plane};
use crate::stats::{median_in_place, normal_cut_factor, range};

/// Residuals beyond this many standard deviations of their cell are gross errors; the variance of the
/// others is divided by [`normal_cut_factor`], 0.994.
pub(super) const CUT_SIGMAS: f64 = 3.5;
/// Cells with fewer pixels than this are merged with their neighbour.
const MIN_CELL_PIXELS: usize = 150;
const CUT_ROUNDS: usize = 6;

/// Sorts the target's pixels into bins of depth, merging small ones: the pixels, and where each cell starts.
pub(super) fn by_cell(
    pixels: &[u32],
    plane: &Plane,
    bench: &Workbench<'_>,
) -> (Vec<u32>, Vec<usize>) {
    let depth = |i: u32| plane.depth_at(&bench.rays, i as usize);
    let [low, high] = range(pixels.iter().map(|&i| depth(i)));
    let bins = Bins::between(low, high.max(0.0));
    let mut groups: Vec<Vec<u32>> = vec![Vec::new(); bins.count];
    for &i in pixels {
        groups[bins.index(depth(i))].push(i);
    }
    let mut sorted = Vec::with_capacity(pixels.len());
    let mut starts = vec![0];
    let mut open = 0;
    for group in groups {
        open += group.len();
        sorted.extend(group);
        if open >= MIN_CELL_PIXELS {
            starts.push(sorted.len());
            open = 0;
        }
    }
    if open > 0 {
        if starts.len() > 1 {
            starts.pop();
        }
        starts.push(sorted.len());
    }
    (sorted, starts)
}

/// Raw words per step of the sensor: 1 where every word occurs, more where a driver stores steps of an eighth
/// of a pixel as millimetres. It is the lower quartile of the gaps between occurring words, each weighted by
/// the rarer of its two words, so that gaps between surfaces count little. Two words may be two surfaces: 1.
pub(crate) fn words_a_step(words: impl Iterator<Item = u16>, table: &DepthTable) -> f64 {
    let mut counts = vec![0u64; 1 << 16];
    words.for_each(|word| counts[usize::from(word)] += 1);
    let is_depth = |&word: &usize| counts[word] > 0 && table.metres(word as u16).is_finite();
    let seen: Vec<usize> = (0..counts.len()).filter(is_depth).collect();
    if seen.len() < 3 {
        return 1.0;
    }
    let gap = |pair: &[usize]| (pair[1] - pair[0], counts[pair[0]].min(counts[pair[1]]));
    let mut gaps: Vec<(usize, u64)> = seen.windows(2).map(gap).collect();
    gaps.sort_unstable();
    let mut left = gaps.iter().map(|gap| gap.1).sum::<u64>() / 4;
    let quartile = gaps.iter().find(|gap| {
        let reached = left < gap.1;
        left = left.saturating_sub(gap.1);
        reached
    });
    quartile.map_or(1.0, |gap| gap.0 as f64)
}

/// Standard deviation within +-[`CUT_SIGMAS`] of itself, corrected for the cut.
pub(super) fn settled_scale(residuals: Vec<f32>, min_scale: f64) -> f64 {
    let mut off: Vec<f32> = residuals.iter().map(|e| e.abs()).collect();
    let mad = f64::from(median_in_place(&mut off));
    let mut scale = if mad.is_finite() { (MAD_TO_SIGMA * mad).max(min_scale) } else { min_scale };
    let factor = normal_cut_factor(CUT_SIGMAS);
    for _ in 0..CUT_ROUNDS {
        let cut = CUT_SIGMAS * scale;
        let (mut n, mut sum) = (0.0, 0.0);
        for &e in &residuals {
            let e = f64::from(e);
            if e.abs() < cut {
                n += 1.0;
                sum += e * e;
            }
        }
        let next = if n > 0.0 { (sum / n / factor).sqrt().max(min_scale) } else { min_scale };
        let settled = (next / scale - 1.0).abs() < 1e-4;
        scale = next;
        if settled {
            break;
        }
    }
    scale
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::DepthCode;
    use crate::rng::Seed;
    use rand_distr::{Distribution, Normal};

    /// A wall at 1.5 m in a wide room, in millimetres, with noise of 3 mm, half of a coarse step.
    #[test]
    fn steps_of_the_sensor_are_met_in_its_words() {
        let mut rng = Seed(3).stream("words");
        let table = DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 }.table();
        for step in [1.0f64, 6.47] {
            for n in [300, 20_000] {
                let noise = Normal::new(0.0, 3.0).unwrap();
                let mut words: Vec<u16> = (0..n)
                    .map(|_| {
                        (step * (noise.sample(&mut rng) / step).round() + 1500.0).round() as u16
                    })
                    .collect();
                words.extend([2047, 4000, 4100, 4107]);
                let found = words_a_step(words.into_iter(), &table);
                assert!((found - step).abs() < 1.0, "{step}: {found}");
            }
        }
        assert_eq!(words_a_step([1500; 9].into_iter(), &table), 1.0, "one word tells no step");
        let board_and_wall = [[1000; 9], [1100; 9]].concat();
        assert_eq!(words_a_step(board_and_wall.into_iter(), &table), 1.0, "nor do two surfaces");
    }
}
