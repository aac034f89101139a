//! Point-to-plane ICP, linearised for small angles (Chen and Medioni 1992). One loop serves all choices of
//! neighbours ([`Target`]), weights ([`Weights`]) and robust kernels ([`Kernel`]).
//!
//! ```text
//! cost(M) = sum (((M s - d) . n) w)^2        s of the source moves, d and its normal n are fixed
//! ```

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::batch::{Batch, Robust};
use super::normal_equations::{Direction, NormalEquations, Solution};
use super::point::{Motion, Point};
use super::{Kernel, Method, Options, Weights};

pub trait Target: Sync {
    /// Result of a search, kept for the next search of the same point.
    type Cache: Default + Clone + Send;
    /// The neighbour of a place, in the target frame.
    fn find(&self, p: &Vector3<f32>, cache: &mut Self::Cache) -> Option<&Point>;
    /// Width of the area that one point represents at a depth of 1 m, m; `Some` enables the `Gate`.
    fn block_width(&self) -> Option<f32> {
        None
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// The step fell below both thresholds.
    Converged,
    MaxIterations,
    /// Too few points have a neighbour.
    TooFewCorrespondences,
}

/// Pose of the source points in the target frame, and its uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    pub target_from_source: Isometry3<f64>,
    /// Covariance of (shift, turn) about the target's origin, m and rad, with errors taken as independent.
    pub covariance: Matrix6<f64>,
    pub iterations: usize,
    pub termination: Termination,
    /// Share of the source points that have a neighbour, before the `Gate`.
    pub inlier_ratio: f64,
    /// Pairs of the last round, on which `covariance` and `rms_m` are based.
    pub correspondences: usize,
    /// Robust sigma of the distances along the normals over their expected sigmas, before the `Gate`: 1 where
    /// the noise model explains all.
    pub misfit: f64,
    /// Root mean square of the distances along the normals, m; `None` without correspondences.
    pub rms_m: Option<f64>,
    /// Motions that the correspondences do not determine; along them the start pose was kept.
    pub degenerate_directions: Vec<Direction>,
    /// [`Direction::information`] of the least determined motion: 0 is none at all.
    pub min_information: f64,
}

/// Fewest pairs: fewer do not determine six parameters under noise.
const MIN_CORRESPONDENCES: usize = 50;
/// Points per task: sums are added in this order, independent of the number of threads.
const CHUNK: usize = 2048;

/// Aligns `source` to `target`, from `start`.
pub fn align<T: Target>(
    source: &[Point],
    target: &T,
    start: Isometry3<f64>,
    options: &Options,
) -> Alignment {
    let mut pose = start;
    let mut cache = vec![T::Cache::default(); source.len()];
    let mut few = Few::of(source, options);
    let mut scale = f64::INFINITY;
    let mut block_width = target.block_width().filter(|_| options.weights == Weights::Both);
    let sizes = options.kernel != Kernel::Square || block_width.is_some();
    let mut gate: Option<Gate> = None;
    let mut near = false;
    let (mut misfit, mut inlier_ratio) = (f64::INFINITY, 0.0);
    let mut last = None;
    let mut termination = Termination::MaxIterations;
    let mut iterations = 0;
    while iterations < options.max_iterations {
        few.enough |= 2 * iterations >= options.max_iterations;
        let coarse = !few.enough;
        let (points, cache) = if coarse {
            (&*few.points, &mut cache[..few.points.len()])
        } else {
            (source, &mut *cache)
        };
        let equations =
            Round { target, options, pose: &pose, scale, gate, sizes }.sum(points, cache);
        iterations += 1;
        let enough = equations.correspondences >= MIN_CORRESPONDENCES;
        let Some(solution) = enough.then(|| equations.solve()).flatten() else {
            if coarse {
                few.enough = true;
                continue;
            }
            if gate.take().is_some() {
                block_width = None;
                continue;
            }
            termination = Termination::TooFewCorrespondences;
            inlier_ratio = 0.0;
            last = None;
            break;
        };
        // The residuals of the first round contain the motion itself; only from the second on do
        // large ones mean outliers.
        if sizes {
            scale = equations.robust_sigma();
        }
        let here = equations.correspondences as f64 / points.len() as f64;
        if gate.is_none() {
            (misfit, inlier_ratio) = (scale, here);
        } else if here < MIN_GATED * inlier_ratio {
            // The gate leaves too little of the picture.
            (gate, block_width) = (None, None);
            continue;
        }
        let step = solution.step;
        pose = renormalised(&(moved(&step) * pose));
        let (shift, turn) = (step.fixed_rows::<3>(0).norm(), step.fixed_rows::<3>(3).norm());
        last = Some((equations, solution));
        // Near convergence, and with all points, the misfit measures the noise.
        let settled = near && !coarse && gate.is_none();
        if let Some(width) = block_width.filter(|_| settled) {
            gate = Some(Gate::of(options.max_correspondence_m, misfit, width));
        } else if !coarse && shift < options.min_shift_m && turn < options.min_turn_rad {
            termination = Termination::Converged;
            break;
        }
        near = shift < NEAR && turn < NEAR;
        few.enough |= near;
    }
    Alignment { termination, iterations, misfit, inlier_ratio, ..Alignment::of(pose, last) }
}

/// Subset of points for the first rounds, which far from the goal serves as well as all. Not used by the
/// paper's method.
struct Few {
    points: Vec<Point>,
    /// Whether all points are used from now on.
    enough: bool,
}

/// The subset has one point in this many.
const FEW: usize = 4;
/// Steps below this, m and rad, are near convergence.
const NEAR: f64 = 1e-3;

impl Few {
    fn of(source: &[Point], options: &Options) -> Self {
        let enough = options.method == Method::Paper || source.len() < FEW * CHUNK / 2;
        let step = if enough { source.len().max(1) } else { FEW };
        Few { points: source.iter().step_by(step).copied().collect(), enough }
    }
}

/// Largest distance within a pair once the motion is nearly found.
///
/// Where the noise model explains the residuals, all pairs within the maximum distance count. Where it
/// does not (other surfaces beside the right one, a rolling shutter), only those within that distance times
/// [`SOUND_MISFIT`] / misfit do. For its benefit see reports/maps.
#[derive(Debug, Clone, Copy)]
struct Gate {
    /// m.
    distance: f32,
    /// Width of a block at a depth of 1 m, m: pairs by projection are up to about a block apart.
    block_width: f32,
}

/// Upper limit of the misfit under a correct noise model, with a Kinect's quantisation: 1.31 to 1.41 in a
/// simulated room. Real films have 3 to 8 with the paper's Eq. 1.
pub const SOUND_MISFIT: f64 = 1.45;
/// Least gate, as a share of the maximum distance: chosen on fr1_rpy among 0.2 to 0.4 (reports/maps).
const MIN_GATE: f64 = 0.2;
/// The gate is dropped where a smaller share of the pairs is left.
const MIN_GATED: f64 = 0.3;

impl Gate {
    fn of(max_m: f32, misfit: f64, block_width: f32) -> Self {
        let share = (SOUND_MISFIT / misfit).clamp(MIN_GATE, 1.0);
        Gate { distance: max_m * share as f32, block_width }
    }

    /// Whether a pair passes, given the depth of its point, m, and its squared distance.
    #[inline]
    fn passes(&self, depth: f32, squared: f32) -> bool {
        let max = self.distance.max(self.block_width * depth);
        squared <= max * max
    }
}

/// Motion of a small step: shift and rotation vector about the target's origin.
fn moved(step: &nalgebra::Vector6<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
    Isometry3::from_parts(Translation3::from(step.fixed_rows::<3>(0).into_owned()), turn)
}

/// Renormalises the rotation: rounding errors grow with each product of products.
pub fn renormalised(pose: &Isometry3<f64>) -> Isometry3<f64> {
    let rotation = UnitQuaternion::new_normalize(pose.rotation.into_inner());
    Isometry3::from_parts(pose.translation, rotation)
}

impl Alignment {
    /// From the sums of the last round, if any; the caller sets the other fields.
    fn of(pose: Isometry3<f64>, last: Option<(NormalEquations, Solution)>) -> Self {
        let (equations, solution) = last.unzip();
        let correspondences = equations.as_ref().map_or(0, |e| e.correspondences);
        let unknown = Matrix6::from_diagonal_element(f64::INFINITY);
        Alignment {
            target_from_source: pose,
            covariance: solution.as_ref().map_or(unknown, |s| s.covariance),
            iterations: 0,
            termination: Termination::MaxIterations,
            inlier_ratio: 0.0,
            correspondences,
            misfit: f64::INFINITY,
            rms_m: equations.map(|e| (e.squares_m2 / correspondences as f64).sqrt()),
            min_information: solution.as_ref().map_or(0.0, |s| s.min_information),
            degenerate_directions: solution.map(|s| s.degenerate_directions).unwrap_or_default(),
        }
    }
}

struct Round<'a, T> {
    target: &'a T,
    options: &'a Options,
    pose: &'a Isometry3<f64>,
    /// Sigma of the inliers' weighted residuals.
    scale: f64,
    gate: Option<Gate>,
    /// Whether the sizes of the residuals are kept.
    sizes: bool,
}

impl<T: Target> Round<'_, T> {
    fn sum(&self, source: &[Point], cache: &mut [T::Cache]) -> NormalEquations {
        let motion = Motion::of(self.pose);
        let min_cosine = self.options.min_cosine as f32;
        let any_normal = min_cosine <= -1.0;
        let robust = Robust { kernel: self.options.kernel, scale: self.scale as f32 };
        let part = |(points, cache): (&[Point], &mut [T::Cache])| {
            let mut batch = Batch::new(self.sizes.then_some(points.len()));
            for (s, cache) in points.iter().zip(cache) {
                let at = motion.moved(&s.at);
                let Some(d) = self.target.find(&at, cache) else { continue };
                if self.gate.is_some_and(|g| !g.passes(s.at.z, (d.at - at).norm_squared())) {
                    continue;
                }
                if any_normal || motion.turned(&s.normal).dot(&d.normal) >= min_cosine {
                    batch.push(&at, d, self.variance(s, d), &robust);
                }
            }
            batch.finish(&robust)
        };
        let parts: Vec<NormalEquations> =
            source.par_chunks(CHUNK).zip(cache.par_chunks_mut(CHUNK)).map(part).collect();
        parts.into_iter().fold(NormalEquations::default(), NormalEquations::plus)
    }

    /// Variance of a residual: one over the weight of its square.
    #[inline]
    fn variance(&self, s: &Point, d: &Point) -> f32 {
        match self.options.weights {
            Weights::None => 1.0,
            Weights::Model => d.sigma_axial * d.sigma_axial,
            Weights::Both => {
                let (s, d) = (s.sigma_normal, d.sigma_normal);
                s * s + d * d
            }
        }
    }
}
