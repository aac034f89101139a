//! The rigid motion that most pairs of points agree on: RANSAC (Fischler and Bolles 1981), seeded.

use nalgebra::{Isometry3, Vector3};

use crate::evaluate::align;
use crate::rng::Stream;

/// Positions of a point in the target frame and in the source frame, m.
pub type PointPair = (Vector3<f64>, Vector3<f64>);

/// The paper's inlier threshold and number of hypotheses.
const MAX_DISTANCE_M: f64 = 0.05;
const HYPOTHESES: usize = 500;

/// Three pairs determine a motion; five more must agree with it, which unrelated pairs do not (tests below).
const MIN_INLIERS: usize = 8;

/// `target_from_source` with the most inliers, fitted to those; `None` with too few.
pub fn ransac(pairs: &[PointPair], rng: &mut Stream) -> Option<Isometry3<f64>> {
    if pairs.len() < MIN_INLIERS {
        return None;
    }
    let mut best: Option<(usize, Isometry3<f64>)> = None;
    for _ in 0..HYPOTHESES {
        let three: Vec<PointPair> =
            rand::seq::index::sample(rng, pairs.len(), 3).iter().map(|i| pairs[i]).collect();
        let Some(motion) = align(&three) else { continue };
        let votes = pairs.iter().filter(|p| agrees(&motion, p)).count();
        if best.is_none_or(|(highest, _)| votes > highest) {
            best = Some((votes, motion));
        }
    }
    // Refit to all inliers, then to the inliers of that fit.
    let mut motion = best?.1;
    for _ in 0..2 {
        let inliers: Vec<PointPair> =
            pairs.iter().filter(|p| agrees(&motion, p)).copied().collect();
        if inliers.len() < MIN_INLIERS {
            return None;
        }
        motion = align(&inliers)?;
    }
    Some(motion)
}

fn agrees(motion: &Isometry3<f64>, (to, from): &PointPair) -> bool {
    let moved = motion.rotation * from + motion.translation.vector;
    (moved - to).norm_squared() < MAX_DISTANCE_M * MAX_DISTANCE_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use rand::Rng;

    /// Three in ten pairs are correct to a millimetre: no draw of 500 has three correct ones with a
    /// probability of (1 - 0.3^3)^500 = 1e-6.
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
        let found = ransac(&pairs, &mut Seed(1).stream("ransac")).unwrap();
        let error = found * truth.inverse();
        let inliers = pairs.iter().filter(|p| agrees(&found, p)).count();
        assert!((60..66).contains(&inliers), "{inliers}");
        assert!(error.translation.vector.norm() < 2e-3 && error.rotation.angle() < 2e-3);
    }

    #[test]
    fn chance_is_not_agreement() {
        let mut rng = Seed(5).stream("pairs");
        let mut place = || Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0));
        let pairs: Vec<PointPair> = (0..60).map(|_| (place(), place())).collect();
        assert_eq!(ransac(&pairs, &mut Seed(1).stream("ransac")), None);
        assert_eq!(ransac(&pairs[..2], &mut Seed(1).stream("ransac")), None);
    }
}
