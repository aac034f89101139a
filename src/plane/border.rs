//! Lost pixels at the target's border: which lie on the target and which beside it.

use std::ops::Range;

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

/// Widest gap of lost pixels that is bridged, px on either side.
const GAP: usize = 2;

/// Whether pixel `i` lies between two of `these` in its row or its column. Lost at random at the target's
/// border, it is the target's all the same.
pub(super) fn is_enclosed(
    i: usize,
    [width, height]: [usize; 2],
    these: &impl Fn(usize) -> bool,
) -> bool {
    let (u, v) = (i % width, i / width);
    let across = |mut us: Range<usize>| us.any(|u| these(v * width + u));
    let along = |mut vs: Range<usize>| vs.any(|v| these(v * width + u));
    let after = |at: usize, end: usize| at + 1..(at + 1 + GAP).min(end);
    across(u.saturating_sub(GAP)..u) && across(after(u, width))
        || along(v.saturating_sub(GAP)..v) && along(after(v, height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_in_the_border_is_the_targets_and_the_ground_beside_it_is_not() {
        const SIZE: [usize; 2] = [9, 6];
        // The left five columns, the last of them the border, with a hole of one pixel and one of two.
        let holes = [13, 31, 40];
        let these = |i: usize| i % 9 < 5 && !holes.contains(&i);
        let enclosed: Vec<usize> =
            (0..54).filter(|&i| !these(i) && is_enclosed(i, SIZE, &these)).collect();
        assert_eq!(enclosed, holes);
    }
}
