//! What must be known of a place before a term can be evaluated there.

use super::basis::{Basis, Coordinate, Modulation};
use super::{Statistic, Term};

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
    const PIXEL: Needs = Needs {
        depth: false,
        slope: false,
        tilt: false,
        board: false,
        session: false,
        temperature: false,
        light: false,
    };
    const DEPTH: Needs = Needs { depth: true, ..Needs::PIXEL };
    const SURFACE: Needs = Needs { depth: true, slope: true, tilt: true, ..Needs::PIXEL };
    const BOARD: Needs = Needs { board: true, ..Needs::SURFACE };

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

    fn over(over: Coordinate) -> Needs {
        match over {
            Coordinate::Column | Coordinate::Row | Coordinate::Radius => Needs::PIXEL,
            Coordinate::Z | Coordinate::LogZ | Coordinate::Disparity => Needs::DEPTH,
            Coordinate::Theta | Coordinate::Azimuth | Coordinate::Along => Needs::SURFACE,
            Coordinate::Right | Coordinate::Down | Coordinate::Edge => Needs::BOARD,
            Coordinate::Session => Needs { session: true, ..Needs::PIXEL },
            Coordinate::Temperature => Needs { temperature: true, ..Needs::PIXEL },
            Coordinate::Light => Needs { light: true, ..Needs::PIXEL },
        }
    }

    fn times(times: Modulation) -> Needs {
        match times {
            Modulation::One => Needs::PIXEL,
            Modulation::DisparitySquared => Needs::DEPTH,
            Modulation::Lift | Modulation::Tilt => Needs::SURFACE,
        }
    }
}

impl Term {
    pub fn needs(&self) -> Needs {
        match &self.basis {
            Basis::Bowl { disparity_power, .. } | Basis::Affine { disparity_power }
                if *disparity_power == 0.0 =>
            {
                Needs::PIXEL
            }
            Basis::Bowl { .. } | Basis::Affine { .. } | Basis::RangeNotDepth => Needs::DEPTH,
            Basis::Locking { .. } | Basis::RangeExponent { .. } => Needs::DEPTH,
            Basis::Lens { .. } => Needs { slope: true, ..Needs::PIXEL },
            Basis::SlopeNoise { .. } | Basis::TiltAxis { .. } => Needs::SURFACE,
            Basis::Ambient { .. } | Basis::Recalibrate { .. } => Needs::SURFACE,
            Basis::Bow { .. } | Basis::EdgeMixing { .. } => Needs::BOARD,
            Basis::Banding { .. } | Basis::Vignetting { .. } | Basis::Level => Needs::PIXEL,
            Basis::Intensity { .. } => Needs { light: true, ..Needs::PIXEL },
            Basis::Curve { over, times, .. } | Basis::Ring { over, times, .. } => {
                Needs::over(*over).and(Needs::times(*times))
            }
            Basis::Map { times, .. } | Basis::Spline { times, .. } => Needs::times(*times),
            Basis::Pair { over, .. } => Needs::over(over[0]).and(Needs::over(over[1])),
        }
    }

    /// Is it a bias that can be taken out of a picture of anything?
    pub fn is_sensor_bias(&self) -> bool {
        // A curve over two axes belongs to the board when either is the board's.
        self.statistic == Statistic::Bias && self.belongs_to_sensor() && !self.needs().board
    }
}
