//! Handles target edges that leave the picture at a slant.

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
