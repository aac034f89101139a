//! Properties of a shape that follow from its coordinates and modulation.

use super::basis::Basis;
use super::coordinate::Coordinate;
use super::modulation::Modulation;
use super::needs::Needs;
use super::place::{Axis, PixelContext};
use super::{Statistic, Term};

impl Basis {
    /// Coordinates it runs over, in order.
    pub(super) fn over(&self) -> [Option<Coordinate>; 2] {
        match self {
            Basis::Level => [None, None],
            Basis::Powers { over, .. }
            | Basis::Waves { over, .. }
            | Basis::Decay { over, .. }
            | Basis::Log1p { over }
            | Basis::Curve { over, .. }
            | Basis::Ring { over, .. } => [Some(*over), None],
            Basis::Lens { .. } => [Some(Coordinate::RaySquared), None],
            Basis::Polynomial { over, .. } | Basis::Pair { over, .. } => over.map(Some),
            Basis::Table { .. } => [Some(Coordinate::Z), Some(Coordinate::Theta)],
            Basis::Map { .. } | Basis::Spline { .. } | Basis::Affine { .. } => {
                [Some(Coordinate::Column), Some(Coordinate::Row)]
            }
        }
    }

    pub(super) fn times(&self) -> Modulation {
        match self {
            Basis::Powers { times, .. }
            | Basis::Polynomial { times, .. }
            | Basis::Waves { times, .. }
            | Basis::Curve { times, .. }
            | Basis::Ring { times, .. }
            | Basis::Map { times, .. }
            | Basis::Spline { times, .. }
            | Basis::Affine { times } => *times,
            Basis::Lens { fx, fy, .. } => Modulation::RadialSlope { fx: *fx, fy: *fy },
            _ => Modulation::One,
        }
    }

    fn is_all(&self, what: fn(Coordinate) -> bool) -> bool {
        self.over().into_iter().flatten().all(what)
    }

    /// Axis that it runs along.
    pub fn axis(&self) -> Axis {
        match (self.over(), self.period()) {
            ([Some(Coordinate::Disparity), None], Some(_)) => Axis::DisparityPhase,
            ([Some(Coordinate::Column), Some(Coordinate::Row)], _) => Axis::Pixel,
            ([Some(first), _], _) => first.axis(),
            ([None, _], _) => Axis::Z,
        }
    }

    /// Period, if it is periodic.
    pub fn period(&self) -> Option<f64> {
        match self {
            Basis::Waves { period, .. } | Basis::Ring { period, .. } => Some(*period),
            _ => None,
        }
    }

    /// Same basis with another period, if it is periodic.
    pub fn with_period(&self, new: f64) -> Self {
        let mut basis = self.clone();
        if let Basis::Waves { period, .. } | Basis::Ring { period, .. } = &mut basis {
            *period = new;
        }
        basis
    }

    /// Coordinate it depends on, if that is one of a view's alone and it changes too fast along it for
    /// patches.
    pub fn alone(&self) -> Option<Coordinate> {
        let smooth = matches!(self, Basis::Powers { .. } | Basis::Log1p { .. });
        match self.over() {
            [Some(over), None] if self.times() == Modulation::One && !smooth => over.alone(),
            _ => None,
        }
    }

    /// Whether it is fixed in the picture, apart from its size.
    pub fn is_of_picture(&self) -> bool {
        *self != Basis::Level && self.is_all(Coordinate::is_of_picture)
    }

    /// Power of the disparity with which a shape grows that is otherwise fixed in the picture. `None` for
    /// periodic shapes, which have next to no affine part.
    pub fn still_power(&self) -> Option<f64> {
        self.power_in_picture().filter(|_| self.period().is_none())
    }

    /// The place, with its disparity clamped to the range, px, in which a shape was learnt that is fixed in
    /// the picture and scales with the disparity.
    pub fn held(&self, [low, high]: [f64; 2], place: &PixelContext) -> PixelContext {
        let inside = (low..=high).contains(&place.disparity);
        if inside || self.still_power().is_none() {
            return *place;
        }
        PixelContext { disparity: place.disparity.clamp(low, high), ..*place }
    }

    /// Same power, of periodic shapes too.
    pub fn power_in_picture(&self) -> Option<f64> {
        self.times().power_of_disparity().filter(|_| self.is_of_picture())
    }

    /// Whether it vanishes on the optical axis by its physics. (So does a matcher's lens, apart from where
    /// its reference was recorded, which no fit determines well.)
    pub fn is_nothing_ahead(&self) -> bool {
        matches!(
            self,
            Basis::Powers { over: Coordinate::RaySquared | Coordinate::Foreshortening, .. }
        )
    }

    /// Whether it is a polynomial about the principal point, without a constant.
    pub fn is_bowl(&self) -> bool {
        matches!(self, Basis::Powers { over: Coordinate::RadiusSquared, .. })
    }

    /// Whether a sigma over depth and tilt can express it.
    pub fn is_of_sigma(&self) -> bool {
        let plain = self.times() == Modulation::One && self.period().is_none();
        plain && self.is_all(Coordinate::is_of_sigma)
    }

    /// Whether it is a shape of the target's surface over the target's own coordinates.
    pub(super) fn is_lift_of_target(&self) -> bool {
        let Basis::Curve { over, times, .. } = self else { return false };
        *times == Modulation::Lift && over.axis() == Axis::TargetPosition
    }

    /// Whether it changes within a few pixels.
    pub fn is_fine(&self) -> bool {
        let over = self.over()[0];
        over == Some(Coordinate::Edge)
            || self.period().is_some() && !over.is_some_and(Coordinate::is_of_picture)
    }

    /// Whether it must be fitted on the smallest patches; what is printed on a target may be as small.
    pub fn needs_tiles(&self) -> bool {
        let printed = self.over()[0] == Some(Coordinate::Light);
        self.is_fine() || self.alone().is_some() || printed
    }
}

impl Term {
    pub fn needs(&self) -> Needs {
        let over = self.basis.over().into_iter().flatten();
        let needs = over.fold(self.basis.times().needs(), |needs, over| needs.and(over.needs()));
        // A matcher's lens stretches the disparity itself.
        Needs { depth: needs.depth || matches!(self.basis, Basis::Lens { .. }), ..needs }
    }

    /// Whether it is the sensor's and can be subtracted from any picture. A board's shape is not.
    pub fn belongs_to_sensor(&self) -> bool {
        !matches!(self.basis.axis(), Axis::TargetPosition | Axis::EdgeDistance)
    }

    /// Whether it is a bias that can be subtracted from a picture of anything.
    pub fn is_sensor_bias(&self) -> bool {
        // A curve over two axes belongs to the board when either is the board's.
        self.statistic == Statistic::Bias && self.belongs_to_sensor() && !self.needs().board
    }

    /// Whether it is a bias that depth images alone suffice to subtract.
    pub fn is_correctable(&self) -> bool {
        self.is_sensor_bias() && !self.needs().light
    }
}
