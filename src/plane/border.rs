//! Lost pixels at the target's border: which lie on the target and which beside it.

use super::grow::Lattice;
use super::image::InverseDepthImage;

/// Unmeasured pixels in nodes at the picture's border that lie beside the target, not on it: those connected
/// over such pixels to nodes outside the target. Where an edge leaves the picture within a node, erosion does
/// not find them, because there are no nodes beyond the border.
pub(super) fn beside(
    image: &InverseDepthImage<'_>,
    lattice: &Lattice,
    target: &[bool],
) -> Vec<bool> {
    let (width, n) = (image.camera.width, image.w.len());
    let at_border = |i: usize| {
        let node = lattice.node_of(i, width);
        let (c, r) = (node % lattice.columns, node / lattice.columns);
        c == 0 || r == 0 || c + 1 == lattice.columns || r + 1 == lattice.rows
    };
    let open = |i: usize| !image.valid(i) && at_border(i);
    let own = |i: usize| target[lattice.node_of(i, width)];
    let mut reached: Vec<bool> = (0..n).map(|i| open(i) && !own(i)).collect();
    let mut queue: Vec<usize> = (0..n).filter(|&i| reached[i]).collect();
    while let Some(i) = queue.pop() {
        let (u, v) = (i % width, i / width);
        let beside = [
            (u > 0).then(|| i - 1),
            (u + 1 < width).then(|| i + 1),
            (v > 0).then(|| i - width),
            (i + width < n).then(|| i + width),
        ];
        for next in beside.into_iter().flatten() {
            if !reached[next] && open(next) {
                reached[next] = true;
                queue.push(next);
            }
        }
    }
    reached
}

/// Longest run of lost pixels that is bridged.
const MAX_RUN: usize = 2;

/// Whether the lost pixel `i` is in a short run of such pixels between two that fit, in its row or its column.
/// Lost at random at the target's border, it is the target's all the same.
pub(super) fn is_enclosed(
    i: usize,
    [width, height]: [usize; 2],
    lost: &impl Fn(usize) -> bool,
    fits: &impl Fn(usize) -> bool,
) -> bool {
    let (u, v) = (i % width, i / width);
    let end = |at: &dyn Fn(usize) -> usize, room: usize| {
        let k = (1..=room.min(MAX_RUN)).find(|k| !lost(at(*k)))?;
        fits(at(k)).then_some(k)
    };
    let is_short =
        |ends: [Option<usize>; 2]| matches!(ends, [Some(a), Some(b)] if a + b <= MAX_RUN + 1);
    is_short([end(&|k| i - k, u), end(&|k| i + k, width - 1 - u)])
        || is_short([end(&|k| i - k * width, v), end(&|k| i + k * width, height - 1 - v)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_in_the_border_is_the_targets_and_the_ground_beside_it_is_not() {
        const SIZE: [usize; 2] = [9, 8];
        // The left five columns, the last of them the border, with holes of one, two and three pixels; the one at
        // the lower end is beside something that does not fit.
        let border = |rows: std::ops::Range<usize>| rows.map(|row| row * 9 + 4);
        let bridged: Vec<usize> = border(1..2).chain(border(3..5)).collect();
        let clutter = 6 * 9 + 4;
        let fits = |i: usize| i % 9 < 5 && !bridged.contains(&i) && i < clutter;
        let lost = |i: usize| !fits(i) && i != clutter;
        let enclosed = |i: &usize| lost(*i) && is_enclosed(*i, SIZE, &lost, &fits);
        assert_eq!((0..72).filter(enclosed).collect::<Vec<_>>(), bridged);
        let wide = |i: usize| i % 9 < 5 && !border(2..5).any(|hole| hole == i);
        let lost = |i: usize| !wide(i);
        assert!(!border(2..5).any(|i| is_enclosed(i, SIZE, &lost, &wide)), "three in a row");
    }
}
