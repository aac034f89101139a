//! How sensor and target stand at one instant: temperature and motion.

use nalgebra::Vector3;

use super::causes::Causes;
use crate::effects::Instant;
use crate::plane::Plane;
use crate::scene::Bench;

/// What changes from frame to frame beside the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Above the temperature at which the reference was recorded, K.
    pub warmth_k: f64,
    /// How far the target has moved away since the view began, m.
    pub moved_m: f64,
}

/// Of a Kinect v1's laser, nm.
const WAVELENGTH_NM: f64 = 830.0;
/// A surface that has moved by about a millimetre shows new speckle.
const SPECKLE_LENGTH_M: f64 = 1e-3;

impl Moment {
    /// At the factory, when the reference was recorded.
    pub const FACTORY: Moment = Moment { warmth_k: 0.0, moved_m: 0.0 };

    pub fn of(causes: &Causes, instant: &Instant) -> Self {
        let share = -(-instant.session_s / causes.warm_up_s).exp_m1();
        Moment { warmth_k: causes.warm_up_k * share, moved_m: causes.motion_mps * instant.view_s }
    }

    /// Sines of the diffracted beams over those at the factory: proportional to the wavelength.
    pub fn pattern_scale(&self, causes: &Causes) -> f64 {
        1.0 + causes.wavelength_nm_per_k * self.warmth_k / WAVELENGTH_NM
    }

    pub fn baseline_scale(&self, causes: &Causes) -> f64 {
        1.0 + causes.expansion_per_k * self.warmth_k
    }

    /// Counts the speckle patterns of a view: the same while the target stands.
    pub fn speckle_epoch(&self) -> i64 {
        (self.moved_m / SPECKLE_LENGTH_M).floor() as i64
    }

    /// The bench as it stands now: the target bowed, and moved along the optical axis.
    pub fn bench(&self, causes: &Causes, at_rest: &Bench) -> Bench {
        let by = Vector3::z() * self.moved_m;
        let normal = at_rest.plane.normal();
        let mut bench = at_rest.clone();
        bench.sagitta_m += causes.bow_m;
        bench.plane =
            Plane::from_normal(normal.into_inner(), at_rest.plane.distance() + normal.dot(&by));
        bench.frame.centre += by;
        bench
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Target;

    #[test]
    fn a_moving_target_is_where_its_speed_takes_it() {
        let bench = Bench::bare(Plane::tilted(2.0, 0.7, 0.3), Target::Wall);
        let causes = Causes::default().with("motion_mps", -0.5).unwrap();
        let instant = Instant { view: 0, frame: 3, session_s: 0.1, view_s: 0.1 };
        let moment = Moment::of(&causes, &instant);
        let moved = moment.bench(&causes, &bench);
        assert!((moved.plane.depth(0.0, 0.0) - 1.95).abs() < 1e-12);
        assert!((moved.plane.theta() - 0.7).abs() < 1e-12);
        assert_ne!(moment.speckle_epoch(), Moment::FACTORY.speckle_epoch());
    }
}
