//! Judges which shape the losses follow, on views left out of its fit.

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::cells::{Cell, Scatter, USUAL, Whitener};
use super::odds::{odds, share};
use super::shapes::{Shape, Step, begun};
use crate::diagnose::checks::replication::Halves;
use crate::diagnose::options::POWER_80;
use crate::diagnose::search::evidence::{Evidence, gain};
use crate::diagnose::search::noise_gains::NoiseGains;
use crate::diagnose::search::null::Null;
use crate::rng::Seed;
use crate::terms::Basis;

/// Prior precision of a step's size about the whole step: 1 ± 0.5.
const STEP_PRECISION: f64 = 4.0;
/// Prior precision of a curve's log odds about zero; they span 12 from nothing lost to everything.
const CURVE_PRECISION: f64 = 0.05;

/// Nats by which a step that begins mid-session must beat the same step without a start: twenty to one.
const CLEARLY: f64 = 3.0;

/// Information below this is ignored, nats.
const NO_SAY: f64 = 1e-6;

/// Losses to be judged: log odds above the share lost everywhere.
pub struct Losses<'a> {
    pub views: &'a [Vec<Cell<'a>>],
    /// Log odds left once earlier findings are subtracted.
    pub left: Vec<Vec<f64>>,
    pub base: f64,
    whiteners: Vec<Whitener>,
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

/// A step's column and information in each view.
struct Column {
    step: Step,
    by_view: Vec<Vec<f32>>,
    a: Vec<f64>,
}

impl Column {
    fn scores(&self, whitened: &[Vec<f64>]) -> Vec<f64> {
        self.by_view.iter().zip(whitened).map(|(g, w)| dot(g, w)).collect()
    }
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

/// Log odds of the share lost everywhere.
fn usual(odds: &[Vec<f64>]) -> f64 {
    let mut all: Vec<f64> = odds.iter().flatten().copied().collect();
    all.sort_by(f64::total_cmp);
    let at = |q: f64| all.get((q * all.len() as f64) as usize).copied().unwrap_or(0.0);
    if share(at(0.5)) < MUCH { at(0.5) } else { at(0.1) }
}

/// Dot product in eight sums, so that no addition waits for the one before.
fn dot(g: &[f32], w: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    for (g, w) in g.chunks(sums.len()).zip(w.chunks(sums.len())) {
        sums.iter_mut().zip(g.iter().zip(w)).for_each(|(sum, (g, w))| *sum += f64::from(*g) * w);
    }
    sums.iter().sum()
}

impl<'a> Losses<'a> {
    /// Subtracts `explained`, which is in log odds above the base.
    pub fn new(views: &'a [Vec<Cell<'a>>], explained: &[Vec<f64>]) -> Self {
        let mut left: Vec<Vec<f64>> = views
            .iter()
            .zip(explained)
            .map(|(cells, e)| cells.iter().zip(e).map(|(c, e)| c.odds() - e).collect())
            .collect();
        // A median of counts has no bias.
        let level = usual(&left).max(odds(0.0));
        for (y, c) in left.iter_mut().flatten().zip(views.iter().flatten()) {
            *y -= c.bias + level;
        }
        let whiteners = views.iter().map(|v| Whitener::of(v, USUAL)).collect();
        Losses { views, left, base: share(level), whiteners }
    }

    /// Re-estimates the scatter from what `best` leaves, bounded below by `min_scatter`.
    pub fn scattered_as_left_by(self, best: &Judged, min_scatter: Scatter) -> Self {
        let explained = self.explained(best);
        let mut left = self.left.clone();
        left.iter_mut().flatten().zip(explained.iter().flatten()).for_each(|(y, e)| *y -= e);
        let scatter = Scatter::of(self.views, &left, min_scatter);
        let whiteners = self.views.iter().map(|v| Whitener::of(v, scatter)).collect();
        Losses { whiteners, ..self }
    }

    /// Log odds that a shape adds to each cell.
    pub fn explained(&self, judged: &Judged) -> Vec<Vec<f64>> {
        let size = &judged.coefficients;
        let views = self.views.iter();
        match &judged.shape {
            Shape::Step(step) => views
                .map(|v| step.column(v, self.base).iter().map(|h| size[0] * h).collect())
                .collect(),
            Shape::Curve(basis) => {
                views.map(|v| v.iter().map(|c| basis.value(size, c.place)).collect()).collect()
            }
        }
    }

    fn column(&self, step: Step) -> Column {
        let columns: Vec<Vec<f64>> = self.views.iter().map(|v| step.column(v, self.base)).collect();
        let information = |(g, w): (&Vec<f64>, &Whitener)| {
            g.iter().zip(w.solve(g)).map(|(g, w)| g * w).sum::<f64>()
        };
        let a: Vec<f64> = columns.iter().zip(&self.whiteners).map(information).collect();
        // Views that the step does not affect are left empty.
        let narrow = |(g, a): (&Vec<f64>, &f64)| {
            g.iter().take(if *a > NO_SAY { g.len() } else { 0 }).map(|h| *h as f32).collect()
        };
        let by_view = columns.iter().zip(&a).map(narrow).collect();
        Column { step, by_view, a }
    }

    /// Gain left without the view it depends on most, nats. A view and its twin differ in where clumps of
    /// losses happen to lie: one clump in a corner of the steepest view is no law of the tilt.
    pub fn beyond_one_view(&self, judged: &Judged) -> f64 {
        let without: Box<dyn Fn(usize) -> f64> = match &judged.shape {
            Shape::Step(step) => {
                let (a, b) = self.information_and_score(*step);
                let beside = |of: &[f64], one: usize| [&of[..one], &of[one + 1..]].concat();
                let cost = step.cost();
                Box::new(move |one| predicted(&beside(&a, one), &beside(&b, one)).0 - cost)
            }
            Shape::Curve(basis) => {
                let evidence = self.evidence(basis);
                Box::new(move |one| {
                    let mut rest = evidence.clone();
                    rest.remove(one);
                    gain(&rest, CURVE_PRECISION).map_or(0.0, |rest| rest.total)
                })
            }
        };
        (0..self.views.len()).map(without).fold(judged.gain, f64::min)
    }

    /// A step's information and score in every view.
    fn information_and_score(&self, step: Step) -> (Vec<f64>, Vec<f64>) {
        let column = self.column(step);
        let scores = column.scores(&self.solve(&self.left));
        (column.a, scores)
    }

    /// Multiplies each view's log odds by the inverse of their covariance.
    fn solve(&self, y: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.whiteners.iter().zip(y).map(|(w, y)| w.solve(y)).collect()
    }

    /// Whether both halves of the views lose by this shape.
    pub fn replicate(&self, judged: &Judged, second: &[bool]) -> Option<bool> {
        match &judged.shape {
            Shape::Step(step) => {
                let (a, b) = self.information_and_score(*step);
                let views = a.into_iter().zip(b).zip(second).filter(|((a, _), _)| *a > 0.0);
                let (views, second): (Vec<_>, Vec<_>) =
                    views.map(|((a, b), second)| (Evidence::of_one(a, b), *second)).unzip();
                Halves::of(&views, &second, 0.0, &[1])?.replicate(&[0], 0.0)
            }
            Shape::Curve(basis) => {
                let views = self.evidence(basis).into_iter().zip(self.views).zip(second);
                let views = views.filter(|((_, cells), _)| !cells.is_empty());
                let (evidence, second): (Vec<_>, Vec<_>) =
                    views.map(|((evidence, _), second)| (evidence, *second)).unzip();
                Halves::of(&evidence, &second, CURVE_PRECISION, &[basis.count()])?
                    .replicate(&[0], 0.0)
            }
        }
    }

    /// Returns the constant step `won` with a start mid-session, if that does clearly better. The scatter of
    /// the views is then not trusted below the usual.
    pub fn later(&self, won: &Judged) -> Option<Judged> {
        let Shape::Step(always @ Step { since_s: None, .. }) = won.shape else { return None };
        let (left, whiteners) = (self.left.clone(), Vec::new());
        let careful = Losses { left, whiteners, ..*self }.scattered_as_left_by(won, USUAL);
        let best = |steps: &[Step]| careful.judge(steps, &[], None).0.into_iter().next();
        let (always, later) = (best(&[always])?, best(&begun(&[always], times(self.views)))?);
        // In the scatter that its rivals were judged with.
        let gain = won.gain + later.gain - always.gain;
        (later.gain > always.gain + CLEARLY).then_some(Judged { gain, ..later })
    }

    fn evidence(&self, basis: &Basis) -> Vec<Evidence> {
        let k = basis.count();
        let of = |v: usize| {
            let cells = &self.views[v];
            let mut rows = vec![0.0; cells.len() * k];
            rows.chunks_exact_mut(k).zip(cells).for_each(|(row, c)| basis.fill(c.place, row));
            let g = DMatrix::from_row_slice(cells.len(), k, &rows);
            let mut a = DMatrix::zeros(k, k);
            for j in 0..k {
                let w = DVector::from_vec(self.whiteners[v].solve(g.column(j).as_slice()));
                a.set_column(j, &(g.transpose() * w));
            }
            let w = DVector::from_vec(self.whiteners[v].solve(&self.left[v]));
            Evidence { a, b: g.transpose() * w }
        };
        (0..self.views.len()).map(of).collect()
    }

    /// Judges all shapes on these losses, and simulates the largest gain that noise alone brings.
    pub fn judge(
        &self,
        steps: &[Step],
        curves: &[Basis],
        null: Option<Seed>,
    ) -> (Vec<Judged>, NoiseGains) {
        let columns: Vec<Column> = steps.par_iter().map(|s| self.column(*s)).collect();
        let whitened = self.solve(&self.left);
        let mut judged: Vec<Judged> = columns
            .iter()
            .map(|c| {
                let (gain, size) = predicted(&c.a, &c.scores(&whitened));
                let gain = gain - c.step.cost();
                Judged { shape: Shape::Step(c.step), gain, coefficients: vec![size] }
            })
            .collect();
        let mut nulls = Vec::new();
        for basis in curves {
            let evidence = self.evidence(basis);
            let Some(won) = gain(&evidence, CURVE_PRECISION) else { continue };
            nulls.extend(Null::of(&evidence, 0, CURVE_PRECISION));
            let coefficients = won.beta.as_slice().to_vec();
            let shape = Shape::Curve(basis.clone());
            judged.push(Judged { shape, gain: won.total, coefficients });
        }
        judged.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let Some(seed) = null else { return (judged, NoiseGains::default()) };
        let draw = |replicate: u64| {
            let mut rng = seed.stream(&format!("missing/null/{replicate}"));
            let mut normal = || StandardNormal.sample(&mut rng);
            let y: Vec<Vec<f64>> = self.whiteners.iter().map(|w| w.draw(&mut normal)).collect();
            let whitened = self.solve(&y);
            let gain = |c: &Column| predicted(&c.a, &c.scores(&whitened)).0 - c.step.cost();
            let steps = columns.iter().map(gain).fold(0.0, f64::max);
            nulls.iter().map(|n| n.draw(&mut rng)).fold(steps, f64::max)
        };
        (judged, NoiseGains::simulated(REPLICATES, MIN_EXCESS_OF_LOSSES, draw))
    }

    /// Farthest whole steps detected with 80 % power; nearest, for losses below them.
    pub fn detectable(&self, steps: &[Step], threshold: f64) -> Vec<Step> {
        // The gain has mean a / 2 and standard deviation sqrt(a).
        let seen = |s: &&Step| {
            let a: f64 = self.column(**s).a.iter().sum();
            s.share == 1.0 && !s.incidence && 0.5 * a - POWER_80 * a.sqrt() > threshold
        };
        let mut all: Vec<Step> = steps.iter().filter(seen).copied().collect();
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
const REPLICATES: u64 = 300;
/// Minimum mean excess of the noise's gains over their 90 % quantile, nats.
pub const MIN_EXCESS_OF_LOSSES: f64 = 1.0;
