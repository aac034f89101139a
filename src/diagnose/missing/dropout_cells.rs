//! What the views lose, patch by patch.

use super::cells::{Cell, Patch, cells, expected, fine, patches, rim_px};
use super::hard_end::HardEnd;
use crate::camera::Camera;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::margins::Margins;

/// The views' losses on the target.
pub struct DropoutCells<'a> {
    /// In patches large enough to judge.
    pub cells: Vec<Vec<Cell<'a>>>,
    /// In the smallest there are.
    pub fine: Vec<Vec<Cell<'a>>>,
    /// Whether a view's region was given.
    pub region_given: Vec<bool>,
    /// Whether it is in the second half.
    pub second: Vec<bool>,
    /// Log odds that the views' twins lose in each patch, over nothing lost.
    pub expected: Option<Vec<Vec<f64>>>,
}

impl<'a> DropoutCells<'a> {
    /// Of views in these `large` patches, beside those of their `twins`.
    pub fn of(
        large: &'a [Vec<Patch>],
        fields: &[Field],
        twins: Option<&Survey>,
        (survey, camera, margins): (&'a Survey, &Camera, &Margins),
    ) -> Self {
        let mut mine = cells(large);
        let expected = twins.map(|survey| {
            expected(&mut mine, &cells(&patches(survey, camera, margins)), rim_px(camera))
        });
        DropoutCells {
            cells: mine,
            fine: fine(survey, margins),
            region_given: fields.iter().map(|f| f.region_given).collect(),
            second: survey.second(),
            expected,
        }
    }

    /// Log odds over the base that are known before the search.
    pub fn explained(&self) -> Vec<Vec<f64>> {
        let nothing = || self.cells.iter().map(|v| vec![0.0; v.len()]).collect();
        self.expected.clone().unwrap_or_else(nothing)
    }

    /// Without the patches that a hard end of the range touches.
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
