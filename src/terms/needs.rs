//! Quantities that must be known at a place to evaluate a term there.

use super::Term;

/// What a term depends on besides the pixel's place in the picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Needs {
    /// Depth or disparity.
    pub depth: bool,
    /// Slope of the surface in disparity.
    pub slope: bool,
    /// Tilt, azimuth or distance of the surface.
    pub tilt: bool,
    /// Coordinates on the calibration target, or the distance to its edge.
    pub board: bool,
    pub session: bool,
    pub temperature: bool,
    /// Brightness of the surface in infrared.
    pub light: bool,
}

impl Needs {
    pub(super) const PIXEL: Needs = Needs {
        depth: false,
        slope: false,
        tilt: false,
        board: false,
        session: false,
        temperature: false,
        light: false,
    };
    pub(super) const DEPTH: Needs = Needs { depth: true, ..Needs::PIXEL };
    pub(super) const SURFACE: Needs =
        Needs { depth: true, slope: true, tilt: true, ..Needs::PIXEL };
    pub(super) const BOARD: Needs = Needs { board: true, ..Needs::SURFACE };

    pub fn and(self, other: Needs) -> Needs {
        Needs {
            depth: self.depth || other.depth,
            slope: self.slope || other.slope,
            tilt: self.tilt || other.tilt,
            board: self.board || other.board,
            session: self.session || other.session,
            temperature: self.temperature || other.temperature,
            light: self.light || other.light,
        }
    }

    /// Needs of all terms together.
    pub fn of<'a>(terms: impl IntoIterator<Item = &'a Term>) -> Needs {
        terms.into_iter().fold(Needs::PIXEL, |needs, term| needs.and(term.needs()))
    }
}
