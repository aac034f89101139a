//! Effects at the edge of the target.

use super::laboratory::{Laboratory, close};

/// First and last column of the board along its middle row.
fn outline(lab: &Laboratory) -> (usize, usize) {
    let seen = lab.seen();
    let row = 120 * lab.width();
    let board: Vec<usize> = (0..lab.width()).filter(|u| seen.is_target(row + u)).collect();
    (board[0], board[board.len() - 1])
}

/// A square footprint of +-4 px across a step of 1 m: the depth is linear between the surfaces over 8 px.
#[test]
fn depth_at_an_edge_is_a_ramp() {
    let lab = Laboratory::board(Some(2.0));
    let frame = lab.clone().with("edge-mixing:width_px=4").frame();
    let (first, last) = outline(&lab);
    let row = 120 * lab.width();
    for k in 0..8usize {
        let ramp = 1.0 + (0.5 - (k as f64 + 0.5) / 8.0).max(0.0);
        close(frame[row + first + k], ramp, 1e-4, "left edge");
        close(frame[row + last - k], ramp, 1e-4, "right edge");
        let behind = 2.0 - (0.5 - (k as f64 + 0.5) / 8.0).max(0.0);
        close(frame[row + first - 1 - k], behind, 1e-4, "the wall beside it");
    }
}

#[test]
fn with_nothing_behind_there_is_nothing_to_mix_or_to_shade() {
    let lab = Laboratory::board(None).noise(0.002);
    for effect in ["edge-mixing", "occlusion-shadow"] {
        let same = lab
            .frame()
            .iter()
            .zip(lab.clone().with(effect).frame())
            .all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "{effect}");
    }
}

/// Invalid pixels of a row left of the board, on it, and right of it.
fn shadow(lab: &Laboratory) -> [usize; 3] {
    let frame = lab.clone().with("occlusion-shadow").frame();
    let (first, last) = outline(lab);
    let row = 120 * lab.width();
    let lost = |from: usize, to: usize| (from..to).filter(|u| frame[row + u].is_nan()).count();
    [lost(0, first), lost(first, last + 1), lost(last + 1, lab.width())]
}

/// Similar triangles: a board at 1 m hides fx b (1 - 1/z) px of a wall at z from a projector one baseline to
/// the right; the shadow is on the left.
#[test]
fn the_shadow_has_the_right_width_on_one_side() {
    for wall in [1.5, 2.0, 4.0] {
        let lab = Laboratory::board(Some(wall));
        let [left, on_it, right] = shadow(&lab);
        let width = 290.0 * 0.075 * (1.0 - 1.0 / wall);
        close(left as f64, width, 1.0, "px in the shadow");
        assert_eq!((on_it, right), (0, 0));
    }
}

#[test]
fn there_is_no_shadow_above_or_below() {
    let frame = Laboratory::board(Some(2.0)).with("occlusion-shadow").frame();
    let above: Vec<f64> = (0..50).map(|v| frame[v * 320 + 160]).collect();
    assert!(above.iter().all(|z| z.is_finite()));
}
