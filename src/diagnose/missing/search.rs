//! Judges which shape the losses follow, on views left out of its fit.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::cells::{Cell, Scatter, USUAL};
use super::odds::{odds, share};
use super::shapes::{Shape, Step, begun};
use crate::diagnose::checks::replication::Halves;
use crate::diagnose::options::POWER_80;
use crate::diagnose::search::evidence::{Evidence, gain};
use crate::diagnose::search::noise_gains::NoiseGains;
use crate::diagnose::search::null::Null;
use crate::diagnose::search::rows::Rows;
use crate::rng::Seed;
use crate::terms::Basis;

/// Prior precision of a step's size about the whole step: 1 ± 0.5.
const STEP_PRECISION: f64 = 4.0;
/// Prior precision of a curve's log odds about zero; they span 12 from nothing lost to everything.
const CURVE_PRECISION: f64 = 0.05;

/// Nats by which a step that begins mid-session must beat the same step without a start: twenty to one.
const CLEARLY: f64 = 3.0;

/// Losses to be judged: log odds above the share lost everywhere.
pub struct Losses<'a> {
    pub views: &'a [Vec<Cell<'a>>],
    /// Log odds left once earlier findings are subtracted.
    pub left: Vec<Vec<f64>>,
    pub base: f64,
    rows: Vec<Rows<'static>>,
}

/// Times of the views since the start of the session, s.
pub fn times(views: &[Vec<Cell<'_>>]) -> impl Iterator<Item = f64> {
    views.iter().filter_map(|v| v.first()).map(|c| c.place.session_s)
}

/// A shape, and how well it predicts views it was not fitted to.
#[derive(Debug, Clone)]
pub struct Judged {
    pub shape: Shape,
    /// Gain over all views, nats.
    pub gain: f64,
    pub coefficients: Vec<f64>,
}

/// Gain (nats) and size of a step from its information and score in each view. Each view is predicted from
/// the others and a prior at the whole step.
pub fn predicted(a: &[f64], b: &[f64]) -> (f64, f64) {
    let (sum_a, sum_b): (f64, f64) = (a.iter().sum(), b.iter().sum());
    let size = |a: f64, b: f64| ((b + STEP_PRECISION) / (a + STEP_PRECISION)).max(0.0);
    let total = a.iter().zip(b).map(|(a, b)| {
        let size = size(sum_a - a, sum_b - b);
        size * (b - 0.5 * size * a)
    });
    (total.sum(), size(sum_a, sum_b))
}

/// Median share lost from which only the best cells show what is lost anyway.
const MUCH: f64 = 0.1;

/// Log odds of the share lost everywhere. A median of counts is a whole one, so each is compared with its own.
fn usual(odds: &[Vec<f64>], views: &[Vec<Cell<'_>>]) -> f64 {
    let all = odds.iter().flatten().zip(views.iter().flatten());
    let mut all: Vec<f64> = all.map(|(odds, c)| odds - c.counting.median).collect();
    all.sort_by(f64::total_cmp);
    let at = |q: f64| all.get((q * all.len() as f64) as usize).copied().unwrap_or(0.0);
    if share(at(0.5)) < MUCH { at(0.5) } else { at(0.1) }
}

/// Gain (nats) and coefficients of a shape of this evidence.
fn gained(shape: &Shape, views: &[Evidence]) -> Option<(f64, Vec<f64>)> {
    match shape {
        Shape::Step(step) => {
            let [a, b] = [|e: &Evidence| e.a[0], |e: &Evidence| e.b[0]]
                .map(|of| views.iter().map(of).collect::<Vec<f64>>());
            let (gain, size) = predicted(&a, &b);
            Some((gain - step.cost(), vec![size]))
        }
        Shape::Curve(_) => {
            let gain = gain(views, CURVE_PRECISION)?;
            Some((gain.total, gain.beta.as_slice().to_vec()))
        }
    }
}

impl<'a> Losses<'a> {
    /// Subtracts `explained`, which is in log odds above the base.
    pub fn new(views: &'a [Vec<Cell<'a>>], explained: &[Vec<f64>]) -> Option<Self> {
        let mut left: Vec<Vec<f64>> = views
            .iter()
            .zip(explained)
            .map(|(cells, e)| cells.iter().zip(e).map(|(c, e)| c.odds() - e).collect())
            .collect();
        let level = usual(&left, views).max(odds(0.0));
        for (y, c) in left.iter_mut().flatten().zip(views.iter().flatten()) {
            *y -= c.counting.bias + level;
        }
        Losses::scattered(views, left, share(level), USUAL)
    }

    fn scattered(
        views: &'a [Vec<Cell<'a>>],
        left: Vec<Vec<f64>>,
        base: f64,
        scatter: Scatter,
    ) -> Option<Self> {
        let rows = views.iter().zip(&left).map(|(cells, left)| scatter.rows(cells, left));
        let rows = rows.collect::<Option<_>>()?;
        Some(Losses { views, left, base, rows })
    }

    /// Re-estimates the scatter from what `best` leaves, bounded below by `min_scatter`.
    pub fn scattered_as_left_by(&self, best: &Judged, min_scatter: Scatter) -> Option<Self> {
        let explained = self.explained(best);
        let mut left = self.left.clone();
        left.iter_mut().flatten().zip(explained.iter().flatten()).for_each(|(y, e)| *y -= e);
        let scatter = Scatter::of(self.views, &left, min_scatter);
        Losses::scattered(self.views, self.left.clone(), self.base, scatter)
    }

    /// Log odds that a shape adds to each cell.
    pub fn explained(&self, judged: &Judged) -> Vec<Vec<f64>> {
        let size = &judged.coefficients;
        let of = |c: &Cell<'_>| match &judged.shape {
            Shape::Step(step) => size[0] * step.adds(c, self.base),
            Shape::Curve(basis) => basis.value(size, c.place),
        };
        self.views.iter().map(|v| v.iter().map(of).collect()).collect()
    }

    /// Evidence of each view on a step's size, or on a curve's coefficients.
    fn evidence(&self, shape: &Shape) -> Vec<Evidence> {
        let of_view = |(rows, cells): (&Rows<'_>, &Vec<Cell<'_>>)| match shape {
            Shape::Step(step) => rows.reduce(1, |i, g| g[0] = step.adds(&cells[i], self.base)),
            Shape::Curve(basis) => rows.reduce(basis.count(), |i, g| basis.fill(cells[i].place, g)),
        };
        self.rows.iter().zip(self.views).map(of_view).collect()
    }

    /// Gain left without the view it depends on most, nats. A view and its twin differ in where clumps of
    /// losses happen to lie: one clump in a corner of the steepest view is no law of the tilt.
    pub fn beyond_one_view(&self, judged: &Judged) -> f64 {
        let evidence = self.evidence(&judged.shape);
        let without = |one: usize| {
            let mut rest = evidence.clone();
            rest.remove(one);
            gained(&judged.shape, &rest).map_or(0.0, |g| g.0)
        };
        (0..evidence.len()).map(without).fold(judged.gain, f64::min)
    }

    /// Whether both halves of the views lose by this shape.
    pub fn replicate(&self, judged: &Judged, second: &[bool]) -> Option<bool> {
        let each = self.evidence(&judged.shape).into_iter().zip(second.iter().copied());
        // Views that see nothing of it have no say.
        let (views, second): (Vec<_>, Vec<_>) = each.filter(|(e, _)| e.a.trace() > 0.0).unzip();
        let (count, prior) = match &judged.shape {
            Shape::Step(_) => (1, 0.0),
            Shape::Curve(basis) => (basis.count(), CURVE_PRECISION),
        };
        Halves::of(&views, &second, prior, &[count])?.replicate(&[0], 0.0)
    }

    /// Returns the constant step `won` with a start mid-session, if that does clearly better. The scatter of
    /// the views is then not trusted below the usual.
    pub fn later(&self, won: &Judged) -> Option<Judged> {
        let Shape::Step(always @ Step { since_s: None, .. }) = won.shape else { return None };
        let careful = self.scattered_as_left_by(won, USUAL)?;
        let best = |steps: &[Step]| careful.judge(steps, &[], None).0.into_iter().next();
        let (always, later) = (best(&[always])?, best(&begun(&[always], times(self.views)))?);
        // In the scatter that its rivals were judged with.
        let gain = won.gain + later.gain - always.gain;
        (later.gain > always.gain + CLEARLY).then_some(Judged { gain, ..later })
    }

    /// Judges all shapes on these losses, and simulates the largest gain that noise alone brings.
    pub fn judge(
        &self,
        steps: &[Step],
        curves: &[Basis],
        null: Option<Seed>,
    ) -> (Vec<Judged>, NoiseGains) {
        let steps = steps.iter().map(|s| Shape::Step(*s));
        let shapes: Vec<Shape> = steps.chain(curves.iter().cloned().map(Shape::Curve)).collect();
        let evidence: Vec<_> = shapes.par_iter().map(|s| self.evidence(s)).collect();
        let judge = |(shape, evidence): (&Shape, &Vec<Evidence>)| {
            let (gain, coefficients) = gained(shape, evidence)?;
            Some(Judged { shape: shape.clone(), gain, coefficients })
        };
        let mut judged: Vec<Judged> = shapes.iter().zip(&evidence).filter_map(judge).collect();
        judged.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let noise = null.map(|seed| self.noise_gains(&shapes, &evidence, seed));
        (judged, noise.unwrap_or_default())
    }

    /// Largest gains of these shapes under noise alone.
    fn noise_gains(&self, shapes: &[Shape], evidence: &[Vec<Evidence>], seed: Seed) -> NoiseGains {
        let (mut steps, mut information, mut nulls) = (Vec::new(), Vec::new(), Vec::new());
        for (shape, views) in shapes.iter().zip(evidence) {
            match shape {
                Shape::Step(step) => {
                    steps.push(*step);
                    information.push(views.iter().map(|e| e.a[0]).collect::<Vec<f64>>());
                }
                Shape::Curve(_) => nulls.extend(Null::of(views, 0, CURVE_PRECISION)),
            }
        }
        let of_view = |(v, rows): (usize, &Rows<'_>)| {
            let noise = rows.noise(REPLICATES, &mut seed.stream(&format!("missing/views/{v}")));
            let fill = |i: usize, g: &mut [f64]| {
                for (g, step) in g.iter_mut().zip(&steps) {
                    *g = step.adds(&self.views[v][i], self.base);
                }
            };
            rows.scores(steps.len(), fill, &noise)
        };
        let scores: Vec<DMatrix<f64>> = self.rows.par_iter().enumerate().map(of_view).collect();
        let draw = |replicate: u64| {
            let of_step = |(k, step): (usize, &Step)| {
                let b: Vec<f64> = scores.iter().map(|s| s[(k, replicate as usize)]).collect();
                predicted(&information[k], &b).0 - step.cost()
            };
            let best = steps.iter().enumerate().map(of_step).fold(0.0, f64::max);
            let mut rng = seed.stream(&format!("missing/curves/{replicate}"));
            nulls.iter().map(|n| n.draw(&mut rng)).fold(best, f64::max)
        };
        NoiseGains::simulated(REPLICATES as u64, MIN_EXCESS_OF_LOSSES, draw)
    }

    /// Farthest whole steps detected with 80 % power; nearest, for losses below them.
    pub fn detectable(&self, steps: &[Step], threshold: f64) -> Vec<Step> {
        // The gain has mean a / 2 and standard deviation sqrt(a).
        let seen = |s: &&Step| {
            let a: f64 = self.evidence(&Shape::Step(**s)).iter().map(|e| e.a[0]).sum();
            0.5 * a - POWER_80 * a.sqrt() > threshold
        };
        let whole = steps.iter().filter(|s| s.share == 1.0 && !s.incidence);
        let mut all: Vec<Step> = whole.filter(seen).copied().collect();
        // Least demanding first: the largest middle, or the smallest where losses lie below.
        all.sort_by(|a, b| (b.middle * b.width.signum()).total_cmp(&(a.middle * a.width.signum())));
        let mut best: Vec<Step> = Vec::new();
        for s in all {
            if best.iter().all(|b| b.axis != s.axis || b.width.signum() != s.width.signum()) {
                best.push(s);
            }
        }
        best
    }
}

/// Simulations of the null distribution.
const REPLICATES: usize = 300;
/// Minimum mean excess of the noise's gains over their 90 % quantile, nats.
pub const MIN_EXCESS_OF_LOSSES: f64 = 1.0;
