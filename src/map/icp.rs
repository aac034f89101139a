//! Point-to-plane ICP, linearised for small angles. The loop is written once; what is a neighbour
//! ([`Target`]), what a pair weighs ([`Weights`]) and how outliers fare ([`Kernel`]) are slots.
//!
//! ```text
//! cost(M) = sum (((M s - d) . n) w)^2        s moves, d and its normal n stand
//! ```

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::direction::Direction;
use super::motion::Motion;
use super::point::Point;
use super::sums::{Solution, Sums};

/// Something to align to.
pub trait Target: Sync {
    /// What a search leaves behind for the next search of the same point.
    type Memory: Default + Clone + Send;
    /// The neighbour of a place, in the target's frame.
    fn find(&self, p: &Vector3<f32>, memory: &mut Self::Memory) -> Option<&Point>;
}

/// What a pair weighs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weights {
    /// All the same.
    None,
    /// The paper's: 1 / sigma(d_z, theta) of the standing point.
    Model,
    /// One over what both points err by together, across the surface, averaged as they are.
    Both,
}

/// How residuals far beyond the usual count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// As any other.
    Square,
    /// With their size, not its square.
    Huber,
    /// Less and less, then not at all.
    Tukey,
}

/// What to do and when to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    pub weights: Weights,
    pub kernel: Kernel,
    pub max_iterations: usize,
    /// A step smaller than both ends it: m and rad.
    pub min_shift_m: f64,
    pub min_turn_rad: f64,
    /// Surfaces that lean more to each other are not one: least cosine of their normals.
    pub min_cosine: f64,
}

/// Why the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The step fell below both thresholds.
    Settled,
    MostIterations,
    /// Too few points have a neighbour.
    TooFewPairs,
}

/// Where the moving points are in the target's frame, and how well that is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    pub target_from_source: Isometry3<f64>,
    /// Of (shift, turn) about the target's origin, m and rad, its errors taken as independent.
    pub covariance: Matrix6<f64>,
    pub iterations: usize,
    pub ending: Ending,
    /// Share of the moving points that have a neighbour.
    pub matched: f64,
    pub pairs: usize,
    /// Root mean square of the distances across the surface, m.
    pub rms_m: f64,
    /// Motions that the pairs do not determine; along them the start was kept.
    pub undetermined: Vec<Direction>,
    /// The least determined motion's share of what the best has: 0 is none at all.
    pub weakest: f64,
}

/// Fewer pairs say nothing about six numbers under noise.
const MIN_PAIRS: usize = 50;
/// Points a task: sums are added in this order whatever the number of threads.
const CHUNK: usize = 2048;

/// Align `source` to `target`, from `start`.
pub fn align<T: Target>(
    source: &[Point],
    target: &T,
    start: Isometry3<f64>,
    criteria: &Criteria,
) -> Alignment {
    let mut pose = start;
    let mut memory = vec![T::Memory::default(); source.len()];
    let mut scale = f64::INFINITY;
    let mut last = None;
    let mut ending = Ending::MostIterations;
    let mut iterations = 0;
    while iterations < criteria.max_iterations {
        let sums = Round { target, criteria, pose: &pose, scale }.sum(source, &mut memory);
        iterations += 1;
        let enough = sums.pairs >= MIN_PAIRS;
        let Some(solution) = enough.then(|| sums.solve()).flatten() else {
            ending = Ending::TooFewPairs;
            last = None;
            break;
        };
        // The first round's residuals hold the motion itself: only from the second on is what
        // stands out an outlier.
        if criteria.kernel != Kernel::Square {
            scale = sums.typical();
        }
        let step = solution.step;
        pose = renormalised(&(moved(&step) * pose));
        let (shift, turn) = (step.fixed_rows::<3>(0).norm(), step.fixed_rows::<3>(3).norm());
        last = Some((sums, solution));
        if shift < criteria.min_shift_m && turn < criteria.min_turn_rad {
            ending = Ending::Settled;
            break;
        }
    }
    finish(pose, last, ending, iterations, source.len())
}

/// exp of a small motion: shift and turn about the target's origin.
fn moved(step: &nalgebra::Vector6<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
    Isometry3::from_parts(Translation3::from(step.fixed_rows::<3>(0).into_owned()), turn)
}

/// A product of rotations is one but for rounding, which products of products double each time.
pub fn renormalised(pose: &Isometry3<f64>) -> Isometry3<f64> {
    let rotation = UnitQuaternion::new_normalize(pose.rotation.into_inner());
    Isometry3::from_parts(pose.translation, rotation)
}

fn finish(
    pose: Isometry3<f64>,
    last: Option<(Sums, Solution)>,
    ending: Ending,
    iterations: usize,
    points: usize,
) -> Alignment {
    let Some((sums, solution)) = last else {
        return Alignment {
            target_from_source: pose,
            covariance: Matrix6::from_diagonal_element(f64::INFINITY),
            iterations,
            ending,
            matched: 0.0,
            pairs: 0,
            rms_m: f64::INFINITY,
            undetermined: Vec::new(),
            weakest: 0.0,
        };
    };
    Alignment {
        target_from_source: pose,
        covariance: solution.covariance,
        iterations,
        ending,
        matched: sums.pairs as f64 / points.max(1) as f64,
        pairs: sums.pairs,
        rms_m: (sums.squares_m2 / sums.pairs as f64).sqrt(),
        undetermined: solution.undetermined,
        weakest: solution.weakest,
    }
}

/// One linearisation.
struct Round<'a, T> {
    target: &'a T,
    criteria: &'a Criteria,
    pose: &'a Isometry3<f64>,
    /// Of weighted residuals that are no outliers.
    scale: f64,
}

impl<T: Target> Round<'_, T> {
    fn sum(&self, source: &[Point], memory: &mut [T::Memory]) -> Sums {
        let motion = Motion::of(self.pose);
        let any_normal = self.criteria.min_cosine <= -1.0;
        let keep_sizes = self.criteria.kernel != Kernel::Square;
        let part = |(points, memory): (&[Point], &mut [T::Memory])| {
            let mut sums = Sums::with_room(if keep_sizes { points.len() } else { 0 });
            for (s, memory) in points.iter().zip(memory) {
                let at = motion.moved(&s.at);
                let Some(d) = self.target.find(&at, memory) else { continue };
                let lean = || f64::from(motion.turned(&s.normal).dot(&d.normal));
                if !any_normal && lean() < self.criteria.min_cosine {
                    continue;
                }
                let residual = f64::from((at - d.at).dot(&d.normal));
                let weight = self.weight(s, d);
                let kept = self.kept(residual * weight);
                sums.add(&at, &d.normal, residual, weight * weight * kept);
                if keep_sizes {
                    sums.sizes.push((residual * weight).abs() as f32);
                }
            }
            sums
        };
        let parts: Vec<Sums> =
            source.par_chunks(CHUNK).zip(memory.par_chunks_mut(CHUNK)).map(part).collect();
        parts.into_iter().fold(Sums::default(), Sums::plus)
    }

    #[inline]
    fn weight(&self, s: &Point, d: &Point) -> f64 {
        match self.criteria.weights {
            Weights::None => 1.0,
            Weights::Model => 1.0 / f64::from(d.axial),
            Weights::Both => 1.0 / f64::from((s.across * s.across + d.across * d.across).sqrt()),
        }
    }

    /// The kernel's weight of a weighted residual.
    #[inline]
    fn kept(&self, weighted: f64) -> f64 {
        let size = (weighted / self.scale).abs();
        match self.criteria.kernel {
            Kernel::Square => 1.0,
            Kernel::Huber => (HUBER / size).min(1.0),
            Kernel::Tukey if size < TUKEY => (1.0 - (size / TUKEY).powi(2)).powi(2),
            Kernel::Tukey => 0.0,
        }
    }
}

/// 95 % as good as least squares where there are no outliers (Holland and Welsch 1977).
const HUBER: f64 = 1.345;
const TUKEY: f64 = 4.685;
