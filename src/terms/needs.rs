//! What must be known of a place before a term can be evaluated there.

use super::Term;

/// What a term looks at beside the pixel's place in the picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Needs {
    /// Depth or disparity.
    pub depth: bool,
    /// Slope of the surface in disparity.
    pub slope: bool,
    /// Its tilt, azimuth or distance.
    pub tilt: bool,
    /// Coordinates on the calibration target, or the way to its edge.
    pub board: bool,
    pub session: bool,
    pub temperature: bool,
    /// How light the surface is in infrared.
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

    /// Of all terms together.
    pub fn of<'a>(terms: impl IntoIterator<Item = &'a Term>) -> Needs {
        terms.into_iter().fold(Needs::PIXEL, |needs, term| needs.and(term.needs()))
    }
}
