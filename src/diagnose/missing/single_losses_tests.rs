//! Single readings that are lost by chance, so few that most patches lose none.

use rand_distr::{Binomial, Distribution};

use super::cells::{Patch, usual_share};
use super::tests::{find, session};
use crate::rng::Seed;

/// A patch of 800 readings loses one or two: the median share is 0.00125 or 0.0025. A tenth of the patches is lost
/// whole.
#[test]
fn the_usual_share_is_no_whole_count_and_no_clump() {
    let mut rng = Seed(1).stream("missing/usual");
    let count = Binomial::new(800, 0.002).unwrap();
    let patch = |k: usize| {
        let lost = if k.is_multiple_of(10) { 800.0 } else { count.sample(&mut rng) as f64 };
        Patch { lost, asked: 800.0, ..Patch::default() }
    };
    let patches: Vec<Patch> = (0..400).map(patch).collect();
    // 576 readings are lost by chance: 4 %.
    assert!((usual_share(&patches, 1.0) / 0.002 - 1.0).abs() < 0.12);
}

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
