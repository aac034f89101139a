//! Single readings that are lost by chance, so few that most patches lose none.

use rand_distr::{Binomial, Distribution};

use super::tests::{find, session};
use crate::rng::Seed;

/// One frame a view: a patch of 400 pixels loses one reading or none, one at the border of 100 hardly any. All
/// lose the same share.
#[test]
fn a_share_lost_everywhere_by_chance_is_no_finding() {
    for seed in 0..8 {
        let mut rng = Seed(seed).stream("missing/single");
        let (mut views, camera) = session(0.0, &mut rng, |_| 0.0);
        for patch in views.iter_mut().flatten() {
            let at_border = !(60.0..580.0).contains(&patch.place.u);
            patch.asked = if at_border { 100.0 } else { 400.0 };
            let lost = Binomial::new(patch.asked as u64, 0.0015).unwrap();
            patch.lost = lost.sample(&mut rng) as f64;
        }
        let found = find(&views, &camera, Seed(seed)).findings;
        let told: Vec<_> = found.iter().map(|f| (f.effect, f.axis)).collect();
        assert!(told.is_empty(), "seed {seed}: {told:?}");
    }
}
