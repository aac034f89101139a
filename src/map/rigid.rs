//! The rigid motion that most pairs of points agree on: RANSAC, seeded.

use nalgebra::{Isometry3, Vector3};

use crate::evaluate::align;
use crate::rng::Stream;

/// Where a point is in the target's frame, and where in the source's, m.
pub type PointPair = (Vector3<f64>, Vector3<f64>);

/// The paper's.
pub const WITHIN_M: f64 = 0.05;
pub const TRIES: usize = 500;

/// Three points make a motion; as many again that agree make it more than chance.
const MIN_AGREED: usize = 8;

/// A motion and who agrees with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreed {
    pub target_from_source: Isometry3<f64>,
    pub pairs: usize,
}

/// The motion that brings most pairs together, fitted to all of those; `None` where too few agree.
pub fn agreed(pairs: &[PointPair], rng: &mut Stream) -> Option<Agreed> {
    if pairs.len() < MIN_AGREED {
        return None;
    }
    let mut best: Option<(usize, Isometry3<f64>)> = None;
    for _ in 0..TRIES {
        let three: Vec<PointPair> =
            rand::seq::index::sample(rng, pairs.len(), 3).iter().map(|i| pairs[i]).collect();
        let Some(motion) = align(&three) else { continue };
        let votes = pairs.iter().filter(|p| agrees(&motion, p)).count();
        if best.is_none_or(|(most, _)| votes > most) {
            best = Some((votes, motion));
        }
    }
    // Once more over all who agree, and over those who agree with that.
    let mut motion = best?.1;
    let mut count = 0;
    for _ in 0..2 {
        let agreeing: Vec<PointPair> =
            pairs.iter().filter(|p| agrees(&motion, p)).copied().collect();
        count = agreeing.len();
        if count < MIN_AGREED {
            return None;
        }
        motion = align(&agreeing)?;
    }
    Some(Agreed { target_from_source: motion, pairs: count })
}

fn agrees(motion: &Isometry3<f64>, (to, from): &PointPair) -> bool {
    let moved = motion.rotation * from + motion.translation.vector;
    (moved - to).norm_squared() < WITHIN_M * WITHIN_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use rand::Rng;

    /// Three in ten pairs are right, to a millimetre: 500 draws of three miss all of them with
    /// probability (1 - 0.3^3)^500 = 1e-6.
    #[test]
    fn a_minority_that_agrees_is_found() {
        let truth = Isometry3::new(Vector3::new(0.1, -0.2, 0.05), Vector3::new(0.1, 0.2, -0.1));
        let mut rng = Seed(3).stream("pairs");
        let mut place = || Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0));
        let mut pairs: Vec<PointPair> = (0..140).map(|_| (place(), place())).collect();
        for _ in 0..60 {
            let p: Vector3<f64> = place();
            let error = place() * 0.0005;
            pairs.push((truth * nalgebra::Point3::from(p) - nalgebra::Point3::from(-error), p));
        }
        let pairs: Vec<PointPair> = pairs;
        let told = agreed(&pairs, &mut Seed(1).stream("ransac")).unwrap();
        let error = told.target_from_source * truth.inverse();
        assert!(told.pairs >= 60 && told.pairs < 66, "{}", told.pairs);
        assert!(error.translation.vector.norm() < 2e-3 && error.rotation.angle() < 2e-3);
    }

    #[test]
    fn chance_is_not_agreement() {
        let mut rng = Seed(5).stream("pairs");
        let mut place = || Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0));
        let pairs: Vec<PointPair> = (0..60).map(|_| (place(), place())).collect();
        assert_eq!(agreed(&pairs, &mut Seed(1).stream("ransac")), None);
        assert_eq!(agreed(&pairs[..2], &mut Seed(1).stream("ransac")), None);
    }
}
