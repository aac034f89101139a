//! One view more, where a diagnosis advised it.

use rand::Rng;

use super::Set;
use super::poses::Plan;
use super::question::Pose;

impl Set {
    /// Take a view after all others, by the same unit of the same target with the same causes at
    /// work. A wall leans no farther than it goes on in the picture. The pose that was taken.
    pub(super) fn add_view(&mut self, pose: &Pose) -> Pose {
        let mut rng = self.seed.stream("rays/advised");
        let (stamp, session_s) =
            self.plans.last().map_or((0.0, 0.0), |p| (p.stamps[0], p.session_s));
        let pause = rng.random_range(60.0..240.0);
        let Pose { z_m, theta_rad, azimuth_rad } = *pose;
        let theta_rad = self.session.within(z_m, theta_rad, azimuth_rad, &self.unit);
        let clocks = [stamp + pause, session_s + pause];
        let tilt = [theta_rad, azimuth_rad];
        let plan = self.session.view(&self.unit, z_m, tilt, clocks, &mut rng);
        self.plans.push(Plan { view: self.plans.len(), ..plan });
        Pose { theta_rad, ..*pose }
    }
}

#[cfg(test)]
mod tests {
    use super::super::question::Pose;
    use super::super::tests_nats::asked;
    use super::super::{Cell, Set};
    use kinoise::plane::Plane;

    /// The pose is the plane's as the diagnosis means it; a wall leans less, and all is later.
    #[test]
    fn the_target_stands_where_it_was_asked_for() {
        let mut walls = 0;
        for seed in 0..8 {
            let of = asked(Cell::Single, &["radial-disparity-bias"], Some(150.0), seed);
            let mut set = Set::sealed(&of, None, None).unwrap();
            let before = set.plans.len();
            let pose = Pose { z_m: 2.9, theta_rad: 1.0, azimuth_rad: 0.8 };
            let taken = set.add_view(&pose);
            let plan = &set.plans[before];
            assert_eq!((set.plans.len(), plan.view), (before + 1, before));
            let wanted = Plane::tilted(taken.z_m, taken.theta_rad, taken.azimuth_rad);
            for (x, y) in [(0.0, 0.0), (0.2, 0.0), (-0.1, 0.15)] {
                assert!((plan.stage.board.depth(x, y) - wanted.depth(x, y)).abs() < 1e-9);
            }
            let wall = plan.stage.board.half.is_none();
            walls += usize::from(wall);
            assert_eq!(wall, taken.theta_rad < pose.theta_rad);
            let earlier = &set.plans[..before];
            assert!(earlier.iter().all(|p| p.session_s < plan.session_s));
            assert!(earlier.iter().all(|p| p.stamps[0] < plan.stamps[0]));
        }
        assert!((1..8).contains(&walls), "{walls} walls of 8");
    }
}
