//! Size and time constant of a warm-up drift, whatever its course.
//!
//! A session rarely lasts until the drift has settled. Its final size and its time constant then depend on
//! the form of the approach, so the posterior is summed over several forms, and over all time constants that
//! a sensor may have.

use super::referenced_view::ReferencedView;
use crate::diagnose::search::evidence::Evidence;
use crate::diagnose::search::posterior::Posterior;
use crate::stats::even;

/// Final size and time constant of the drift, as the card's own formula fits them best, with RMS deviations
/// over the other courses.
#[derive(Debug, Clone, Copy)]
pub struct WarmUp {
    pub relative: [f64; 2],
    pub time_constant_s: [f64; 2],
}

/// Share of the drift reached after so many time constants, 63 % after one: heating of one mass, as on the
/// card; of several, which takes longer; and a course that ends sooner.
const COURSES: [fn(f64) -> f64; 3] =
    [|t| -(-t).exp_m1(), |t| t / (t + (std::f64::consts::E - 1.0).recip()), |t| (0.745 * t).tanh()];

/// Time constants tried, evenly in the logarithm; `TAU_SESSIONS` are the first and last in session lengths.
const TAUS: usize = 240;
const TAU_SESSIONS: [f64; 2] = [0.02, 20.0];
/// A sensor's housing warms in a quarter of an hour, as on the card, within a factor of e or so.
const TYPICAL_TAU_S: f64 = 900.0;
/// Prior: sensors drift by a per cent or two at most (the card's source: some mm at 1 to 2 m, in 20 min).
const USUAL: f64 = 0.02;

/// Fits the warm-up of a session of this length; `None` for a length of zero. `evidence` gives the
/// references' evidence on a drift, its last column, that moves each of them by so many metres per unit size.
pub fn warm_up(
    session_s: f64,
    evidence: impl Fn(&dyn Fn(&ReferencedView) -> f64) -> Vec<Evidence>,
) -> Option<WarmUp> {
    if session_s <= 0.0 {
        return None;
    }
    let log = TAU_SESSIONS.map(|n| (n * session_s).ln());
    let nodes: Vec<Node> = COURSES
        .iter()
        .enumerate()
        .flat_map(|(course, of)| even(log, TAUS).map(move |log| (course, of, log.exp())))
        .filter_map(|(course, of, tau_s)| {
            let (likely, relative) =
                size(&evidence(&|c| c.without_law() * of(c.session_s / tau_s)))?;
            let unlikely = 0.5 * (tau_s / TYPICAL_TAU_S).ln().powi(2);
            Some(Node { course, tau_s, evidence: likely - unlikely, relative })
        })
        .collect();
    let told = nodes.iter().filter(|n| n.course == 0);
    let told = told.max_by(|a, b| a.evidence.total_cmp(&b.evidence))?;
    let ([relative, _], tau_s) = (told.relative, told.tau_s);
    let posterior = Posterior::of(nodes, |n| (n.evidence, 1.0))?;
    let off = |n: &Node| (n.relative[0] - relative).powi(2) + n.relative[1].powi(2);
    Some(WarmUp {
        relative: [relative, posterior.mean(off).sqrt()],
        time_constant_s: [tau_s, posterior.rms(|n| n.tau_s - tau_s)],
    })
}

struct Node {
    course: usize,
    tau_s: f64,
    /// Log marginal likelihood plus log prior, nats.
    evidence: f64,
    /// Relative size and its standard error.
    relative: [f64; 2],
}

/// Least-squares size of the drift for a given course, and the log marginal likelihood.
fn size(views: &[Evidence]) -> Option<(f64, [f64; 2])> {
    let others = views.first()?.b.len() - 1;
    let Evidence { mut a, b } = Evidence::sum(others + 1, 0.0, views);
    for j in 0..=others {
        // The nuisance parameters are free: their prior standard deviation is a whole unit.
        a[(j, j)] += if j == others { USUAL.powi(-2) } else { 1.0 };
    }
    let solved = a.cholesky()?;
    let beta = solved.solve(&b);
    let log_determinant = 2.0 * solved.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    let covariance = solved.inverse();
    let evidence = 0.5 * (beta.dot(&b) - log_determinant);
    evidence.is_finite().then(|| (evidence, [beta[others], covariance[(others, others)].sqrt()]))
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::Seed;

    const ERROR_M: f64 = 0.001;
    const PX_M: f64 = 43.5;

    /// Fits the drift without nuisance parameters.
    fn found(checked: &[ReferencedView]) -> Option<WarmUp> {
        let session_s = checked.iter().map(|r| r.session_s).fold(0.0, f64::max);
        warm_up(session_s, |moves| {
            let of = |c: &ReferencedView| Evidence {
                a: DMatrix::from_element(1, 1, (moves(c) / ERROR_M).powi(2)),
                b: DVector::from_element(1, moves(c) * c.off / ERROR_M.powi(2)),
            };
            checked.iter().map(of).collect()
        })
    }

    /// Sessions of an hour at most, for each course. The intervals should hold the end of a drift that the
    /// session did not see: 90 % of 40 are 36, and 31 or fewer have a chance of 2 %.
    #[test]
    fn intervals_hold_whatever_the_course() {
        for (number, course) in COURSES.iter().enumerate() {
            let mut held = [0; 2];
            for seed in 0..40 {
                let mut rng = Seed(seed).stream("warm up");
                let relative = rng.random_range(0.003..0.02);
                let (tau_s, session_s) =
                    (rng.random_range(400.0..1500.0), rng.random_range(900.0..3600.0));
                let checked: Vec<ReferencedView> = (0..16)
                    .map(|k| {
                        let (z, at_s) = (rng.random_range(0.6..4.0), session_s * k as f64 / 15.0);
                        let noise: f64 = StandardNormal.sample(&mut rng);
                        let off = relative * z * course(at_s / tau_s) + ERROR_M * noise;
                        let ahead = ReferencedView::ahead(z + off, off, PX_M);
                        ReferencedView { session_s: at_s, ..ahead }
                    })
                    .collect();
                let told = found(&checked).expect("a drift");
                let numbers = [(told.relative, relative), (told.time_constant_s, tau_s)];
                for (k, ([said, error], truth)) in numbers.into_iter().enumerate() {
                    held[k] += usize::from((said - truth).abs() <= 1.645 * error);
                }
            }
            println!("course {number}: {held:?} of 40");
            assert!(held.iter().all(|n| *n >= 32), "course {number}: {held:?}");
        }
    }

    #[test]
    fn no_time_no_drift() {
        let still = [0.8, 1.5, 2.5].map(|z| ReferencedView::ahead(z, 0.001, PX_M));
        assert!(found(&still).is_none());
        assert!(found(&[]).is_none());
    }
}
