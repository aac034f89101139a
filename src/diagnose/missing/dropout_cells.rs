//! Losses of the views, patch by patch.

use super::cells::Cell;
use super::hard_end::HardEnd;

/// Losses of the views on the target.
pub struct DropoutCells<'a> {
    /// Patches large enough to judge.
    pub cells: Vec<Vec<Cell<'a>>>,
    /// Smallest patches.
    pub fine: Vec<Vec<Cell<'a>>>,
    /// Whether a view's region was given.
    pub region_given: Vec<bool>,
    /// Whether each view is in the second half.
    pub second: Vec<bool>,
    /// Log odds of the twins' losses in each patch, above those of no loss.
    pub expected: Option<Vec<Vec<f64>>>,
}

impl<'a> DropoutCells<'a> {
    /// Copy without the patches that a hard end of the range touches.
    pub fn inside(&self, end: &HardEnd) -> DropoutCells<'a> {
        fn kept<T: Clone>(of: &[Vec<T>], cells: &[Vec<Cell<'_>>], end: &HardEnd) -> Vec<Vec<T>> {
            let inside = |(of, cells): (&Vec<T>, &Vec<Cell<'_>>)| {
                let both = of.iter().zip(cells).filter(|(_, c)| !end.touches(c));
                both.map(|(of, _)| of.clone()).collect()
            };
            of.iter().zip(cells).map(inside).collect()
        }
        let (cells, fine) = (&self.cells, &self.fine);
        DropoutCells {
            cells: kept(cells, cells, end),
            fine: kept(fine, fine, end),
            region_given: self.region_given.clone(),
            second: self.second.clone(),
            expected: self.expected.as_ref().map(|e| kept(e, cells, end)),
        }
    }
}
