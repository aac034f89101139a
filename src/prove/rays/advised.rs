//! One view more, where a diagnosis advised it.

use rand::Rng;

use super::Set;
use super::poses::Plan;
use crate::prove::Pose;

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
