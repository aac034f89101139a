//! The target's edge in one view: where every row and column crosses it, how the depth changes to that of the
//! background, and what is lost beside it.
//!
//! A footprint that sees both surfaces shifts the target's last pixels by a share of the step. What the
//! projector cannot light is lost on one side, over a width equal to the drop in disparity. Both are sums
//! over hundreds of crossings and all frames, so that a thousandth of the step can be seen.

pub mod mixing;
pub mod scan;
pub mod shadow;

/// Pixels of the target used, from its edge inwards. Beside a smooth bias (three columns a view) the last
/// pixel keeps 0.68 of its information with 24 pixels, 0.45 with 12; a footprint of 4 px 0.27 and 0.05.
pub const INSIDE_PX: usize = 24;
/// Fewest pixels used, where the target is narrow.
const MIN_INSIDE_PX: usize = 12;

/// Sums over the crossings at one distance from the edge.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sums {
    pub n: f64,
    /// Sum of the residuals, px.
    pub residual: f64,
    /// Sum of the steps to the background, px: negative.
    pub step: f64,
    pub product: f64,
    pub square: f64,
}

/// One view's losses beside the target, over a number of rows.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct EdgeLoss {
    /// Sum over the rows of the width lost, less what is lost anyway; in one frame unless noted otherwise.
    pub lost: f64,
    /// Sum over the rows of the width that the geometry predicts.
    pub shaded: f64,
    pub rows: f64,
    /// Readings lost, of how many, where the shadow may be and beyond it; none beside a twin.
    pub counts: [[f64; 2]; 2],
}

/// One line's crossing of the edge.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    /// Index of the last pixel on the target.
    last: isize,
    /// Whether the pixel beside it was lost alone in the first frame, and may be the target's.
    is_doubtful: bool,
    /// Index step from one pixel to the next, outwards.
    stride: isize,
    /// Disparity of the background less that of the plane, px.
    step: f64,
    /// Number of target pixels used, including the last.
    inside: usize,
    /// Left (0) or right (1) of the target, with room for its shadow.
    side: Option<usize>,
}

/// All crossings of a view's edge.
#[derive(Debug, Clone, Default)]
pub struct Edges {
    crossings: Vec<Crossing>,
    frames: usize,
    pub inside: [Sums; INSIDE_PX],
    /// Left and right; `lost` is summed over all frames but the first, where there are others.
    sides: [EdgeLoss; 2],
    pub sigma_px: f64,
    /// Drop in disparity from the target to the background, px.
    pub step_px: f64,
}

/// Fewest rows that show anything of a side.
const MIN_ROWS: f64 = 8.0;

impl Edges {
    /// Pixels lost per frame on a side (0 left, 1 right).
    pub fn lost_px(&self, side: usize) -> f64 {
        self.sides[side].lost / self.frames.saturating_sub(1).max(1) as f64
    }

    /// Losses per frame on a side; `None` where too few rows were seen.
    pub fn beside(&self, side: usize) -> Option<EdgeLoss> {
        let beside = EdgeLoss { lost: self.lost_px(side), ..self.sides[side] };
        (beside.rows >= MIN_ROWS).then_some(beside)
    }
}
