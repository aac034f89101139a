//! The target's edge in one view: where every row and column crosses it, how the depth goes over
//! to what is behind, and what is lost beside it.
//!
//! A footprint that sees both surfaces shifts the target's last pixels by a share of the step; what
//! the projector cannot light is lost on one side, as wide as the disparity falls. Both are sums
//! over hundreds of crossings and all frames, so that a thousandth of the step can be seen.

pub mod mixing;
pub mod scan;
pub mod shadow;

/// Pixels of the target that are looked at, from its edge inwards: beside a smooth bias, three columns a view, the
/// last pixel of 24 keeps .68 of what it tells, of 12 .45; a footprint of 4 px .27 and .05.
pub const INSIDE_PX: usize = 24;
/// Where the target is narrow, this many.
const MIN_INSIDE_PX: usize = 12;

/// Sums over the crossings at one distance from the edge.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sums {
    pub n: f64,
    /// Of the residual, px.
    pub residual: f64,
    /// Of the step to what is behind, px: negative.
    pub step: f64,
    pub product: f64,
    pub square: f64,
}

/// One view's pixels beside the target, over so many rows.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct EdgeLoss {
    /// Sum over the rows of the width lost, less what is lost anyway: in one frame, where not said otherwise.
    pub lost: f64,
    /// Sum over the rows of the width that geometry has.
    pub shaded: f64,
    pub rows: f64,
}

/// One line's way over the edge.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    /// Of the last pixel on the target.
    last: isize,
    /// From one pixel to the next, outwards.
    stride: isize,
    /// Disparity of what is behind less that of the plane, px.
    step: f64,
    /// Pixels of the target, the last among them.
    inside: usize,
    /// Left or right of the target with room for its shadow.
    side: Option<usize>,
}

/// All crossings of a view's edge.
#[derive(Debug, Clone, Default)]
pub struct Edges {
    crossings: Vec<Crossing>,
    frames: usize,
    pub inside: [Sums; INSIDE_PX],
    /// Left and right; what is lost, in all frames.
    sides: [EdgeLoss; 2],
    pub sigma_px: f64,
    /// From the target down to what is behind, px.
    pub step_px: f64,
}

/// Rows of fewer pixels than this show nothing of a side.
const MIN_ROWS: f64 = 8.0;

impl Edges {
    /// Pixels lost in a frame on a side (0 left, 1 right).
    pub fn lost_px(&self, side: usize) -> f64 {
        self.sides[side].lost / self.frames.max(1) as f64
    }

    /// What is beside the target on a side in a frame; `None` where too few rows were seen.
    pub fn beside(&self, side: usize) -> Option<EdgeLoss> {
        let beside = EdgeLoss { lost: self.lost_px(side), ..self.sides[side] };
        (beside.rows >= MIN_ROWS).then_some(beside)
    }
}
