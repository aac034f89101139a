//! Trials of candidates alongside the chosen terms.

use nalgebra::DVector;
use rayon::prelude::*;

use super::beside::Beside;
use super::candidate::Candidate;
use super::evidence::{Evidence, Gain, gain};
use super::layer_null::{Group, LayerNull};
use super::noise_gains::REPLICATES;
use super::null::Null;
use super::outcome::{Chosen, Look};
use super::prepared::Prepared;
use super::rules::Rules;
use super::view_noise::Scores;
use crate::rng::Seed;
use crate::terms::Basis;

/// Prepared views and chosen terms that candidates are tried with.
pub struct Trial<'a> {
    pub beside: Vec<Chosen>,
    pub views: Vec<Prepared<'a>>,
    /// Columns of the terms fitted alongside.
    pub settled: usize,
    /// Whether a term is pinned: it and the named terms are then fitted to all views, including the left-out
    /// ones. Fitted to the others alone, a free surface goes astray where one view reaches farther than they
    /// do, and a candidate that bends it back would seem to be found.
    pub is_pinned: bool,
    /// Total weight of the samples.
    pub weight: f64,
    pub rules: &'a Rules,
    /// Root mean square of the largest term so far.
    pub largest: f64,
}

/// Noise as a nest's widest candidate sees it.
pub enum NestNoise {
    /// Scores of each view, one column a draw.
    Shared(Vec<Scores>),
    /// The noise of the samples it is tried on was not drawn: seed and name of the nest's own stream.
    Apart(Seed, String),
}

impl NestNoise {
    /// Gains of the candidate whose `null` and `evidence` these are.
    fn gains(&self, null: &Null, beside: &Beside, evidence: &[Evidence]) -> Vec<f64> {
        let columns = evidence.first().map_or(0, |e| e.b.len());
        match self {
            NestNoise::Shared(scores) => {
                let own = scores.iter().map(|all| all.rows(0, columns).map(f64::from)).collect();
                null.gains(&beside.scores(evidence, own))
            }
            NestNoise::Apart(seed, name) => {
                null.draws(&mut seed.stream(&format!("{name}/{columns}")))
            }
        }
    }
}

impl Trial<'_> {
    /// Draws the noise of all views, and scores each nest's widest candidate on it.
    pub fn noise(
        &self,
        candidates: &[Candidate],
        nests: &[Vec<usize>],
        seed: Seed,
    ) -> Vec<NestNoise> {
        let widest: Vec<&Basis> = nests.iter().map(|nest| &candidates[nest[0]].basis).collect();
        let of_view = |(v, view): (usize, &Prepared<'_>)| {
            let noise = view.noise(REPLICATES, &mut seed.stream(&format!("diagnose/noise/{v}")));
            view.noise_scores(&widest, &noise)
        };
        let mut views: Vec<Vec<Option<Scores>>> =
            self.views.par_iter().enumerate().map(of_view).collect();
        let of_nest = |n: usize| {
            let scores: Option<Vec<Scores>> = views.iter_mut().map(|v| v[n].take()).collect();
            let apart = || NestNoise::Apart(seed, format!("diagnose/null/{n}"));
            scores.map_or_else(apart, NestNoise::Shared)
        };
        (0..nests.len()).map(of_nest).collect()
    }

    /// Judges the candidates of a nest, given by index, with their gains of the `noise` if given. Families
    /// already chosen are left out: what their shape misses is left to the curves.
    pub fn judged(
        &self,
        candidates: &[Candidate],
        nest: &[usize],
        noise: Option<&NestNoise>,
    ) -> Vec<(usize, Judged)> {
        let taken = |c: &Candidate| {
            let same = |old: &Chosen| c.family.is_some() && old.candidate.family == c.family;
            self.beside.iter().any(same)
        };
        let open = || nest.iter().copied().filter(|&k| !taken(&candidates[k]));
        let Some(widest) = open().next().map(|k| &candidates[k].basis) else { return Vec::new() };
        let mut evidence: Vec<Evidence> = self.views.iter().map(|v| v.evidence(widest)).collect();
        let before = if self.is_pinned {
            None
        } else {
            let alongside: Vec<Evidence> = evidence.iter().map(|e| e.first(self.settled)).collect();
            gain(&alongside, self.rules.prior)
        };
        let judged = |k: usize| {
            let c = &candidates[k];
            evidence.iter_mut().for_each(|e| e.truncate(self.settled + c.basis.count()));
            Some((k, self.judged_by(c, &evidence, before.as_ref(), noise)?))
        };
        open().filter_map(judged).collect()
    }

    /// Judges a candidate by the views' evidence on it and the terms alongside. `before` is the gain of these terms
    /// without it.
    fn judged_by(
        &self,
        c: &Candidate,
        evidence: &[Evidence],
        before: Option<&Gain>,
        noise: Option<&NestNoise>,
    ) -> Option<Judged> {
        let (m, prior) = (self.settled, self.rules.prior);
        let beside = Beside::of(evidence, m, prior)?;
        let alone = beside.alone(evidence);
        let null = Null::of_candidate(&alone, prior)?;
        let gain = if self.is_pinned {
            gain(&alone, prior)?
        } else {
            gain(evidence, prior)?.over(before?)
        };
        if !c.agrees(own(&gain, &c.basis)) {
            return None;
        }
        let rms = self.rms(own(&gain, &c.basis), evidence);
        let sensible = rms >= self.rules.min_rms(&c.basis, self.largest);
        let of_noise = noise.map_or_else(Vec::new, |noise| noise.gains(&null, &beside, evidence));
        Some(Judged { gain, null, of_noise, sensible, rms })
    }

    /// Root mean square of a candidate's fit over the samples, with the nuisances profiled out.
    fn rms(&self, fit: &[f64], evidence: &[Evidence]) -> f64 {
        let (m, k) = (self.settled, fit.len());
        let beta = DVector::from_column_slice(fit);
        let square: f64 =
            evidence.iter().map(|e| beta.dot(&(e.a.view((m, m), (k, k)) * &beta))).sum();
        (square / self.weight).max(0.0).sqrt()
    }
}

/// A candidate's gain, its size, and whether it is plausible.
pub struct Judged {
    pub gain: Gain,
    pub null: Null,
    /// Gains of simulated noise, nats; empty unless the layer's null is being simulated.
    pub of_noise: Vec<f64>,
    /// Large enough beside the largest term, and larger than what fixed errors of the pixels make by
    /// chance.
    pub sensible: bool,
    pub rms: f64,
}

impl Judged {
    /// Gain calibrated for comparison with the null distribution, nats.
    pub fn calibrated_gain(&self, rules: &Rules) -> f64 {
        self.null.calibrated_gain(self.gain.total, self.gain.by_view.len(), rules)
    }
}

pub fn looks(
    candidates: &[Candidate],
    judged: &[Option<Judged>],
    rules: &Rules,
    noise: &LayerNull,
) -> Vec<Look> {
    let nameless = candidates.iter().zip(judged).filter(|(c, _)| c.family.is_none());
    nameless
        .filter_map(|(c, j)| {
            let j = j.as_ref()?;
            Some(Look {
                basis: c.basis.clone(),
                coefficients: own(&j.gain, &c.basis).to_vec(),
                p: noise.p(Group::Other, j.calibrated_gain(rules)),
            })
        })
        .collect()
}

/// A candidate's coefficients, which come last.
pub fn own<'a>(gain: &'a Gain, basis: &Basis) -> &'a [f64] {
    let beta = gain.beta.as_slice();
    &beta[beta.len() - basis.count()..]
}

/// Groups candidates, by index and widest first, so that each one's columns are the first columns of
/// those before it: evidence on the widest contains that on all.
pub fn nests(candidates: &[Candidate]) -> Vec<Vec<usize>> {
    let mut nests: Vec<(Basis, Vec<usize>)> = Vec::new();
    for (k, c) in candidates.iter().enumerate() {
        let series = c.basis.series();
        match nests.iter_mut().find(|(of, _)| *of == series) {
            Some((_, nest)) => nest.push(k),
            None => nests.push((series, vec![k])),
        }
    }
    let widest_first = |(_, mut nest): (Basis, Vec<usize>)| {
        nest.sort_by_key(|&k| std::cmp::Reverse(candidates[k].basis.count()));
        nest
    };
    nests.into_iter().map(widest_first).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::search::Layer;
    use crate::diagnose::search::tests::{RULES, session};
    use crate::terms::{Coordinate, Modulation, PixelContext};

    /// Candidates of fewer orders come before and between wider ones; another period or modulation
    /// makes another nest.
    #[test]
    fn a_nest_has_the_first_columns_of_its_widest() {
        let (over, reference_px) = (Coordinate::RadiusSquared, 12.0);
        let lens = |orders| Basis::Lens { fx: 580.0, fy: 582.0, reference_px, orders };
        let leveled = |orders| {
            let times = Modulation::Tilt;
            Basis::Powers { over: Coordinate::Z, orders, level: true, times }
        };
        let bases = [
            Basis::powers(over, 2, Modulation::One),
            Basis::waves(Coordinate::Column, 40.0, 3),
            Basis::powers(over, 4, Modulation::One),
            Basis::waves(Coordinate::Column, 50.0, 8),
            Basis::waves(Coordinate::Column, 40.0, 8),
            Basis::powers(over, 1, Modulation::DisparitySquared),
            lens(1),
            lens(4),
            Basis::relief(2),
            Basis::relief(4),
            leveled(1),
            leveled(3),
        ];
        let candidates: Vec<Candidate> = bases.into_iter().map(Candidate::curve).collect();
        let nests = nests(&candidates);
        let expected: [&[usize]; 7] = [&[2, 0], &[4, 1], &[3], &[5], &[7, 6], &[9, 8], &[11, 10]];
        assert_eq!(nests, expected);
        let place = PixelContext {
            u: 310.0,
            x: 0.1,
            y: -0.2,
            z: 1.7,
            disparity: 25.6,
            theta: 0.4,
            radius: 0.6,
            right: 0.3,
            down: -0.2,
            rho: 1.7,
            side: 8.0,
            ..PixelContext::default()
        };
        let row = |k: usize| {
            let basis = &candidates[k].basis;
            let mut row = vec![0.0; basis.count()];
            basis.fill(&place, &mut row);
            row
        };
        for nest in nests {
            for &k in &nest {
                assert!(row(nest[0]).starts_with(&row(k)), "{:?}", candidates[k].basis);
            }
        }
    }

    /// With a named term already chosen.
    #[test]
    fn in_a_nest_each_is_judged_as_it_is_alone() {
        let mut rng = Seed(4).stream("search/nest");
        let views = session(&mut rng, |p| 0.5 * p.radius.powi(4) + 0.3 * (p.u / 20.0).sin());
        let (over, times) = (Coordinate::RadiusSquared, Modulation::power(0.0));
        let named = |basis| Candidate::named("radial-disparity-bias", basis);
        let mut candidates: Vec<Candidate> =
            [1, 4, 2].map(|orders| named(Basis::powers(over, orders, times))).into();
        let waves = |harmonics| Basis::waves(Coordinate::Column, 125.0, harmonics);
        candidates.extend([2, 4].map(|k| Candidate::named("column-banding", waves(k))));
        let locking =
            Candidate::named("pixel-locking", Basis::waves(Coordinate::Disparity, 1.0, 2));
        let layer = Layer::of(&views, &views, &candidates, &RULES, Seed(1));
        let trial = layer.trial(&[layer.pin(locking)]).expect("views");
        assert!(trial.settled == 4 && layer.nests == [vec![1, 2, 0], vec![4, 3]]);
        for nest in &layer.nests {
            let together = trial.judged(&candidates, nest, None);
            assert_eq!(together.len(), nest.len());
            for (k, judged) in together {
                let (_, alone) = trial.judged(&candidates, &[k], None).remove(0);
                approx::assert_relative_eq!(judged.gain.total, alone.gain.total, epsilon = 1e-9);
                approx::assert_relative_eq!(judged.gain.beta, alone.gain.beta, epsilon = 1e-9);
                approx::assert_relative_eq!(judged.rms, alone.rms, epsilon = 1e-9);
            }
        }
    }
}
