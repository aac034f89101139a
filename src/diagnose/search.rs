//! The search for missing terms: best first, each step judged on held-out views against what
//! noise alone would have brought.

use rayon::prelude::*;

use super::candidate::Candidate;
use super::evidence::{Evidence, Gain, Null, Rows, gain};
use super::tiles::SIDE;
use crate::model::Covariance;
use crate::rng::Seed;
use crate::terms::{Basis, Coordinate, PixelContext, Term};

/// One view's samples.
#[derive(Clone)]
pub struct ViewData {
    pub places: Vec<PixelContext>,
    pub response: Vec<f64>,
    pub weight: Vec<f64>,
    /// Row-major, as many columns as `precision` has entries.
    pub nuisance: Vec<f64>,
    /// Holds each nuisance to zero; 0 leaves it free.
    pub precision: Vec<f64>,
    /// For larger patches: which of them each sample of the finer data went to.
    pub gathered: Vec<u32>,
}

/// Two tiles by two made one.
pub fn coarser(fine: &ViewData) -> ViewData {
    let side = (2 * SIDE) as f64;
    let p = fine.precision.len();
    let mut groups: std::collections::BTreeMap<(u32, u32), Vec<usize>> = Default::default();
    for (i, place) in fine.places.iter().enumerate() {
        let key = ((place.v / side) as u32, (place.u / side) as u32);
        groups.entry(key).or_default().push(i);
    }
    let mut coarse = ViewData {
        places: Vec::with_capacity(groups.len()),
        response: Vec::with_capacity(groups.len()),
        weight: Vec::with_capacity(groups.len()),
        nuisance: Vec::with_capacity(groups.len() * p),
        precision: fine.precision.clone(),
        gathered: vec![0; fine.places.len()],
    };
    for (k, members) in groups.values().enumerate() {
        members.iter().for_each(|&i| coarse.gathered[i] = k as u32);
        let weight: f64 = members.iter().map(|&i| fine.weight[i]).sum();
        let mean = |of: &dyn Fn(usize) -> f64| {
            if weight > 0.0 {
                members.iter().map(|&i| fine.weight[i] * of(i)).sum::<f64>() / weight
            } else {
                of(members[0])
            }
        };
        let mut place = fine.places[members[0]];
        place.average(&fine.places, &mean);
        place.side = side;
        coarse.places.push(place);
        coarse.response.push(mean(&|i| fine.response[i]));
        coarse.weight.push(weight);
        coarse.nuisance.extend((0..p).map(|q| mean(&|i| fine.nuisance[i * p + q])));
    }
    coarse
}

/// How a search decides.
#[derive(Debug, Clone, Copy)]
pub struct Rules {
    /// Chance that noise alone is taken for a term.
    pub level: f64,
    /// Precision of a coefficient nothing is known about, in its own unit.
    pub prior: f64,
    /// A name must explain this share of what the best curve does.
    pub adequacy: f64,
    pub most_terms: usize,
    /// Constant error of every pixel, px, and pixels of the picture: a pattern that stands still
    /// in the picture must be larger than what these errors make by chance.
    pub fixed: Option<(f64, f64)>,
    /// Root mean square of the least term that is worth a word, in the response's unit.
    pub least: f64,
    /// Judge gains by what noise alone would have brought.
    pub calibrated: bool,
    /// Views that the model was learnt from, where these views are not among them: its own error is
    /// theirs scattered about their mean, and stands beside the error of these.
    pub learnt_from: Option<f64>,
}

/// A family beside the one that was chosen.
#[derive(Debug, Clone)]
pub struct Rival {
    pub family: &'static str,
    pub basis: Basis,
    /// Nats over the terms before, over the root of how much more than noise the views disagree.
    pub gain: f64,
    /// How far behind the chosen one, in standard errors over the views.
    pub behind: f64,
}

/// A term that was accepted.
#[derive(Debug, Clone)]
pub struct Chosen {
    pub candidate: Candidate,
    /// Root mean square, in the response's unit.
    pub rms: f64,
    /// The share of the best curve that its name had to explain.
    pub adequacy: f64,
    /// Nats over the terms before it.
    pub gain: f64,
    /// The best nameless curve's at the same step, nats.
    pub best_curve: f64,
    /// All families at this step, best first, the chosen one too where it has a name.
    pub rivals: Vec<Rival>,
    /// Chance that noise brings as much anywhere in this layer.
    pub p: f64,
}

/// A later term must be this large beside the largest, root mean square by root mean square.
const LEAST_OF_LARGEST: f64 = 0.06;

/// What a single nameless curve saw, before anything was explained.
#[derive(Debug, Clone)]
pub struct Look {
    pub basis: Basis,
    pub coefficients: Vec<f64>,
    pub p: f64,
}

/// All terms of a layer with their common fit.
pub struct Outcome {
    pub chosen: Vec<Chosen>,
    /// Every nameless curve on its own, on the data as they came.
    pub looks: Vec<Look>,
    /// Fit of all terms at once.
    pub fit: Option<Gain>,
    pub evidence: Vec<Evidence>,
    pub noise: NoiseGains,
    /// What still stood out when the search ended.
    pub remaining: Option<Chosen>,
    /// Coefficients as fitted without some views, for these views.
    pub left_out: Vec<(Vec<usize>, Vec<f64>)>,
    /// Of all coefficients.
    pub covariance: Covariance,
}

impl Outcome {
    /// Coefficients of term number `k` in the common fit: the first and the one after the last.
    pub fn span(&self, k: usize) -> std::ops::Range<usize> {
        let first = self.chosen[..k].iter().map(|c| c.candidate.basis.count()).sum();
        first..first + self.chosen[k].candidate.basis.count()
    }

    pub fn coefficients(&self, k: usize) -> Vec<f64> {
        let span = self.span(k);
        self.fit.as_ref().map_or_else(Vec::new, |f| f.beta.as_slice()[span].to_vec())
    }
}

/// Of families that predict as well as the best, the one with the fewest columns is meant.
const AS_GOOD_NATS: f64 = 2.0;
/// So they do within this share of a large gain: no family's shape is exact.
const AS_GOOD_SHARE: f64 = 0.01;
/// A later term must bring this share of what the first brought: what is less is the first one's
/// own shape, badly met.
const LEAST_SHARE: f64 = 0.005;

/// Search a layer. `coarse` has the same views in larger patches, for shapes that do not change
/// within them.
pub fn search(
    fine: &[ViewData],
    coarse: &[ViewData],
    candidates: &[Candidate],
    rules: &Rules,
    seed: Seed,
) -> Outcome {
    search_beside(fine, coarse, candidates, None, rules, seed)
}

/// The same, with a term that is fitted beside every other, whatever it brings: what it can take
/// up is nobody else's. It stays in, last of the chosen.
pub fn search_beside(
    fine: &[ViewData],
    coarse: &[ViewData],
    candidates: &[Candidate],
    beside: Option<Candidate>,
    rules: &Rules,
    seed: Seed,
) -> Outcome {
    let mut layer = Layer {
        fine,
        coarse,
        candidates,
        rules,
        noise: None,
        looks: Vec::new(),
        largest: 0.0,
        pinned: None,
        seed,
    };
    let mut chosen: Vec<Chosen> = Vec::new();
    layer.pinned = beside.map(|candidate| layer.pin(candidate));
    let mut remaining = None;
    while let Some(next) = layer.step(&chosen) {
        let little = chosen.first().is_some_and(|first| next.gain < LEAST_SHARE * first.gain);
        if little || chosen.len() >= rules.most_terms {
            remaining = Some(next);
            break;
        }
        layer.largest = layer.largest.max(next.rms);
        let nameless = next.candidate.family.is_none();
        if nameless && chosen.iter().all(|c| c.candidate.family.is_some()) {
            layer.look_back(&mut chosen);
        }
        chosen.push(next);
    }
    if chosen.iter().all(|c| c.candidate.family.is_some()) {
        layer.look_back(&mut chosen);
    }
    layer.refine_maps(&mut chosen);
    chosen.extend(layer.pinned.clone());
    let evidence = layer.evidence_of(&bases(&chosen));
    let fit = if chosen.is_empty() { None } else { gain(&evidence, rules.prior) };
    let noise = layer.noise.unwrap_or_default();
    let looks = layer.looks;
    Outcome {
        chosen,
        looks,
        fit,
        evidence,
        noise,
        remaining,
        left_out: Vec::new(),
        covariance: Covariance::default(),
    }
}

/// Evidence of views on given terms together.
pub fn evidence_of(data: &[ViewData], terms: &[Term]) -> Vec<Evidence> {
    evidence_of_bases(data, &terms.iter().map(|t| &t.basis).collect::<Vec<_>>())
}

pub fn evidence_of_bases(data: &[ViewData], bases: &[&Basis]) -> Vec<Evidence> {
    data.par_iter()
        .filter_map(|v| Some(rows(v, v.response.clone(), bases)?.reduce(0, |_, _| ())))
        .collect()
}

/// The greatest gains that noise alone brings, ascending, nats.
#[derive(Debug, Clone, Default)]
pub struct NoiseGains(Vec<f64>);

/// Simulations of the null.
const REPLICATES: u64 = 600;
/// Beyond this quantile the tail of a log likelihood falls as an exponential.
const TAIL: f64 = 0.1;

impl NoiseGains {
    pub fn of(nulls: &[&Null], seed: Seed) -> Self {
        let mut greatest: Vec<f64> = (0..REPLICATES)
            .into_par_iter()
            .map(|replicate| {
                let mut rng = seed.stream(&format!("diagnose/null/{replicate}"));
                nulls.iter().map(|null| null.draw(&mut rng)).fold(0.0, f64::max)
            })
            .collect();
        greatest.sort_by(f64::total_cmp);
        NoiseGains(greatest)
    }

    /// Noise is taken to bring next to nothing.
    fn unknown() -> Self {
        NoiseGains(vec![0.0])
    }

    fn cut(&self) -> (f64, f64) {
        let cut = self.0[((self.0.len() - 1) as f64 * (1.0 - TAIL)) as usize];
        let tail: Vec<f64> = self.0.iter().filter(|g| **g > cut).map(|g| g - cut).collect();
        (cut, (tail.iter().sum::<f64>() / tail.len().max(1) as f64).max(0.5))
    }

    /// Exceeded with probability `level`.
    pub fn threshold(&self, level: f64) -> f64 {
        if self.0.is_empty() {
            return f64::INFINITY;
        }
        let (cut, mean_excess) = self.cut();
        cut + mean_excess * (TAIL / level).ln().max(0.0)
    }

    /// Chance of exceeding `gain`.
    pub fn p(&self, gain: f64) -> f64 {
        if self.0.is_empty() {
            return 1.0;
        }
        let (cut, mean_excess) = self.cut();
        if gain > cut {
            return TAIL * (-(gain - cut) / mean_excess).exp();
        }
        let above = self.0.len() - self.0.partition_point(|g| *g < gain);
        (above as f64 / self.0.len() as f64).max(TAIL)
    }
}

/// A view made ready for the candidates.
struct Prepared<'a> {
    fine: (&'a [PixelContext], Rows),
    coarse: (&'a [PixelContext], Rows),
    /// The fine samples gathered by one coordinate, with a place for each group.
    groups: Vec<(Coordinate, Vec<PixelContext>, Rows)>,
}

struct Layer<'a> {
    fine: &'a [ViewData],
    coarse: &'a [ViewData],
    candidates: &'a [Candidate],
    rules: &'a Rules,
    noise: Option<NoiseGains>,
    looks: Vec<Look>,
    /// Root mean square of the largest term so far.
    largest: f64,
    /// Fitted beside everything.
    pinned: Option<Chosen>,
    seed: Seed,
}

struct Judged {
    gain: Gain,
    null: Null,
    /// Can it be meant: of a sensible shape, and larger than what constant errors of the pixels
    /// make by chance.
    sensible: bool,
    rms: f64,
}

fn bases(chosen: &[Chosen]) -> Vec<&Basis> {
    bases_where(chosen, |_| true)
}

fn bases_where(chosen: &[Chosen], which: impl Fn(&Candidate) -> bool) -> Vec<&Basis> {
    chosen.iter().map(|c| &c.candidate).filter(|c| which(c)).map(|c| &c.basis).collect()
}

impl<'a> Layer<'a> {
    /// Evidence of the views on these terms together.
    fn evidence_of(&self, terms: &[&Basis]) -> Vec<Evidence> {
        let fine = terms.iter().any(|b| b.is_fine() || b.of_column_alone());
        let views = if fine { self.fine } else { self.coarse };
        views
            .par_iter()
            .filter_map(|v| Some(rows(v, v.response.clone(), terms)?.reduce(0, |_, _| ())))
            .collect()
    }

    /// Terms with a name are fitted anew beside every candidate; those without have many columns
    /// and are taken out as they were fitted.
    fn prepare(&self, chosen: &[Chosen]) -> Vec<Prepared<'a>> {
        let named: Vec<&Basis> = bases_where(chosen, |c| c.family.is_some());
        let nameless: Vec<&Basis> = bases_where(chosen, |c| c.family.is_none());
        let mut settled: Vec<(&Basis, Vec<f64>)> = Vec::new();
        if !nameless.is_empty() {
            let all: Vec<&Basis> = nameless.iter().chain(&named).copied().collect();
            let fit = gain(&self.evidence_of(&all), self.rules.prior);
            let beta = fit.map_or_else(Vec::new, |f| f.beta.as_slice().to_vec());
            let mut rest = beta.as_slice();
            for basis in nameless {
                if rest.len() >= basis.count() {
                    let (mine, others) = rest.split_at(basis.count());
                    settled.push((basis, mine.to_vec()));
                    rest = others;
                }
            }
        }
        let pairs: Vec<(&ViewData, &ViewData)> = self.fine.iter().zip(self.coarse).collect();
        pairs.par_iter().filter_map(|(f, c)| prepare(f, c, &named, &settled)).collect()
    }

    /// A term that stays, with what it brings alone.
    fn pin(&self, candidate: Candidate) -> Chosen {
        let alone = gain(&self.evidence_of(&[&candidate.basis]), self.rules.prior);
        let gain = alone.map_or(0.0, |g| g.total);
        let (adequacy, rivals) = (self.rules.adequacy, Vec::new());
        Chosen { candidate, rms: 0.0, adequacy, gain, best_curve: 0.0, rivals, p: 1.0 }
    }

    /// The best candidate beside `chosen` and what is pinned, if it brings more than noise can.
    fn step(&mut self, chosen: &[Chosen]) -> Option<Chosen> {
        let with_pinned: Vec<Chosen> = self.pinned.iter().chain(chosen).cloned().collect();
        let chosen = &with_pinned[..];
        let views = self.prepare(chosen);
        let before: Vec<Evidence> = views.iter().map(|v| v.coarse.1.reduce(0, |_, _| ())).collect();
        let m = before.first()?.b.len();
        let base = if m > 0 {
            gain(&before, self.rules.prior)?
        } else {
            let none = nalgebra::DVector::zeros(0);
            Gain {
                total: 0.0,
                by_view: vec![0.0; views.len()],
                beta: none,
                covariance: nalgebra::DMatrix::zeros(0, 0),
            }
        };
        let judged: Vec<Option<Judged>> = self
            .candidates
            .par_iter()
            .map(|c| {
                // A name is taken once; what its shape misses is left to the curves.
                let taken =
                    c.family.is_some() && chosen.iter().any(|old| old.candidate.family == c.family);
                if taken {
                    return None;
                }
                let evidence: Vec<Evidence> = views.iter().map(|v| v.evidence(&c.basis)).collect();
                let null = Null::of(&evidence, m, self.rules.prior)?;
                let mut gain = gain(&evidence, self.rules.prior)?;
                gain.total -= base.total;
                gain.by_view.iter_mut().zip(&base.by_view).for_each(|(g, b)| *g -= b);
                let rms = self.rms(&c.basis, m, &gain, &evidence);
                let sensible = self.sensible(&c.basis, m, &gain, rms);
                Some(Judged { gain, null, sensible, rms })
            })
            .collect();
        if self.noise.is_none() {
            let nulls: Vec<&Null> = judged.iter().flatten().map(|j| &j.null).collect();
            let noise = if self.rules.calibrated {
                NoiseGains::of(&nulls, self.seed)
            } else {
                NoiseGains::unknown()
            };
            let safe = |j: &Judged| self.safe(j.gain.total, &j.null);
            self.looks = looks(self.candidates, &judged, &noise, &safe);
            self.noise = Some(noise);
        }
        let noise = self.noise.as_ref()?;
        self.choose(&judged, noise, chosen)
    }

    fn choose(
        &self,
        judged: &[Option<Judged>],
        noise: &NoiseGains,
        chosen: &[Chosen],
    ) -> Option<Chosen> {
        let total = |i: usize| judged[i].as_ref().map_or(f64::NEG_INFINITY, |j| j.gain.total);
        // Views that scatter more than their noise says count for less.
        let safe = |i: usize| judged[i].as_ref().map_or(0.0, |j| self.safe(j.gain.total, &j.null));
        // A name whose fits to single views disagree is the worse one.
        let fair = |i: usize| {
            judged[i].as_ref().map_or(f64::NEG_INFINITY, |j| {
                if total(i) > 0.0 { total(i) / j.null.dispersion.sqrt() } else { total(i) }
            })
        };
        let ranked = |named: bool, by: &dyn Fn(usize) -> f64| {
            let mut order: Vec<usize> = (0..self.candidates.len())
                .filter(|&i| self.candidates[i].family.is_some() == named)
                .collect();
            order.sort_by(|&a, &b| by(b).total_cmp(&by(a)));
            order
        };
        let (families, curves) = (ranked(true, &fair), ranked(false, &total));
        let threshold = noise.threshold(self.rules.level);
        let best_curve = curves.first().map_or(f64::NEG_INFINITY, |&i| total(i));
        let best_family = families.first().map_or(f64::NEG_INFINITY, |&i| fair(i));
        let named = families
            .iter()
            .copied()
            .filter(|&i| fair(i) > best_family - AS_GOOD_NATS.max(AS_GOOD_SHARE * best_family))
            .min_by_key(|&i| (self.candidates[i].basis.count(), !self.rests_on_a_measurement(i)))
            .filter(|&i| safe(i) > threshold && total(i) > self.adequacy(i) * best_curve)
            // What fewer columns without a name do better is not what the name says.
            .filter(|&i| {
                let columns = |k: usize| self.candidates[k].basis.count();
                let simpler = |&k: &usize| columns(k) < columns(i) && total(k) > total(i);
                !curves.iter().any(simpler)
            })
            .filter(|&i| judged[i].as_ref().is_some_and(|j| j.sensible))
            .filter(|&i| {
                let clear = total(i) > CLEAR * best_curve;
                clear || judged[i].as_ref().is_some_and(steady)
            });
        let sensible = |i: usize| {
            let again = chosen.iter().any(|c| same_curve(&c.candidate, &self.candidates[i]));
            !again && judged[i].as_ref().is_some_and(|j| j.sensible)
        };
        let winner = named
            .or_else(|| curves.iter().copied().find(|&i| safe(i) > threshold && sensible(i)))?;
        let won = &judged[winner].as_ref()?.gain;
        let mut rivals: Vec<Rival> = Vec::new();
        for &i in &families {
            let (Some(family), Some(j)) = (self.candidates[i].family, &judged[i]) else { continue };
            if rivals.iter().all(|r| r.family != family) {
                rivals.push(Rival {
                    family,
                    basis: self.candidates[i].basis.clone(),
                    gain: fair(i),
                    behind: behind(&won.by_view, &j.gain.by_view),
                });
            }
        }
        Some(Chosen {
            candidate: self.candidates[winner].clone(),
            rms: judged[winner].as_ref().map_or(0.0, |j| j.rms),
            adequacy: self.adequacy(winner),
            gain: total(winner),
            best_curve,
            rivals,
            p: noise.p(safe(winner)),
        })
    }

    /// How much more than noise the views' common fit may be off from a model that is right.
    fn excess(&self, null: &Null) -> f64 {
        match self.rules.learnt_from {
            Some(views) => null.about_fit * (1.0 + self.fine.len() as f64 / views),
            None => null.dispersion,
        }
    }

    /// Nats that count against what noise brings. Where the views' own scatter is the noise, it was
    /// measured on these few views: of a Gaussian that makes a Student's t.
    fn safe(&self, gain: f64, null: &Null) -> f64 {
        let nats = gain / self.excess(null);
        match self.rules.learnt_from {
            Some(_) if nats > 0.0 => {
                let freedom = (self.fine.len() as f64 - 1.0).max(1.0);
                0.5 * freedom * (2.0 * nats / freedom).ln_1p()
            }
            _ => nats,
        }
    }

    /// Light of the room was measured for its own sake; the surface's is made out of an image that
    /// the room lights too.
    fn rests_on_a_measurement(&self, i: usize) -> bool {
        matches!(self.candidates[i].basis, Basis::Ambient { .. })
    }

    /// The share of the best curve that a name must explain. Bands on a real sensor ride on a
    /// smooth error of the column that is no band's; the law of sigma has columns for nearly
    /// everything that happens to go with the distance.
    fn adequacy(&self, i: usize) -> f64 {
        match self.candidates[i].basis {
            Basis::Banding { .. } => BANDS_ADEQUATE.min(self.rules.adequacy),
            Basis::Recalibrate { .. } | Basis::Level => LAW_ADEQUATE.max(self.rules.adequacy),
            _ => self.rules.adequacy,
        }
    }

    /// Root mean square of a candidate's fit over the samples, the nuisances taken out.
    fn rms(&self, basis: &Basis, m: usize, gain: &Gain, evidence: &[Evidence]) -> f64 {
        let k = basis.count();
        let beta = gain.beta.rows(m, k).into_owned();
        let square: f64 =
            evidence.iter().map(|e| beta.dot(&(e.a.view((m, m), (k, k)) * &beta))).sum();
        let weight: f64 = self.coarse.iter().flat_map(|v| &v.weight).sum();
        (square / weight).max(0.0).sqrt()
    }

    fn sensible(&self, basis: &Basis, m: usize, gain: &Gain, rms: f64) -> bool {
        let beta = gain.beta.rows(m, basis.count()).into_owned();
        if let Basis::RangeExponent { orders: 2.., .. } = basis {
            let ends = self.fine.iter().flat_map(|v| v.places.iter().map(|p| p.z));
            return one_way(basis, beta.as_slice(), crate::stats::range(ends));
        }
        let k = basis.count();
        let least = self.rules.least.max(LEAST_OF_LARGEST * self.largest);
        if rms < least {
            return false;
        }
        let Some((fixed, pixels)) = self.rules.fixed.filter(|_| basis.is_of_picture()) else {
            return true;
        };
        // Seven times what a fit to nothing but the pixels' own errors would make, for the best of
        // many and for views that cover little of the picture.
        const CLEARLY: f64 = 50.0;
        rms * rms > CLEARLY * fixed * fixed * k as f64 / pixels
    }

    /// Maps with twice as many nodes, where those predict left-out views better.
    fn refine_maps(&self, chosen: &mut [Chosen]) {
        for k in 0..chosen.len() {
            let Basis::Map { width, height, across, down, times } = chosen[k].candidate.basis
            else {
                continue;
            };
            let finer = Basis::Map { width, height, across: 2 * across, down: 2 * down, times };
            let total = |terms: &[&Basis]| {
                gain(&self.evidence_of(terms), self.rules.prior).map_or(0.0, |g| g.total)
            };
            let mut old = bases(chosen);
            old.extend(self.pinned.iter().map(|c| &c.candidate.basis));
            let mut new = old.clone();
            new[k] = &finer;
            let better = total(&new) - total(&old);
            if self.noise.as_ref().is_some_and(|n| better > n.threshold(self.rules.level)) {
                chosen[k].gain += better;
                chosen[k].candidate.basis = finer;
            }
        }
    }

    /// With all names in, is each still what fits best, and needed at all?
    fn look_back(&mut self, chosen: &mut Vec<Chosen>) {
        let mut k = 0;
        while chosen.len() > 1 && k < chosen.len() {
            let mut others = chosen.clone();
            let old = others.remove(k);
            match self.step(&others) {
                None => {
                    chosen.remove(k);
                    continue;
                }
                Some(new) if new.candidate.family == old.candidate.family => {
                    chosen[k] = Chosen { p: old.p.min(new.p), ..new };
                }
                // Another name is taken; a curve without one is not.
                Some(new) if new.candidate.family.is_some() => chosen[k] = new,
                Some(_) => {}
            }
            k += 1;
        }
        chosen.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    }
}

/// A nameless curve that is in already, perhaps with other nodes.
fn same_curve(a: &Candidate, b: &Candidate) -> bool {
    let key = |c: &Candidate| match c.basis {
        // A step and a smooth curve are not one.
        Basis::Curve { over, times, nodes, .. } => Some((format!("{over:?}{}", nodes == 2), times)),
        Basis::Map { times, .. } => Some(("map".to_string(), times)),
        _ => None,
    };
    let both_nameless = a.family.is_none() && b.family.is_none();
    both_nameless && (a.basis == b.basis || key(a).is_some_and(|k| Some(k) == key(b)))
}

/// Up all along, or down: what turns round is no power of z.
fn one_way(basis: &Basis, beta: &[f64], [near, far]: [f64; 2]) -> bool {
    const NODES: usize = 24;
    const BACK: f64 = 0.12;
    let mut row = Vec::new();
    let mut at = |k: usize| {
        let z = near * (far / near).powf(k as f64 / (NODES - 1) as f64);
        basis.value(beta, &PixelContext { z, ..PixelContext::default() }, &mut row)
    };
    let values: Vec<f64> = (0..NODES).map(&mut at).collect();
    let (mut up, mut down) = (0.0, 0.0);
    for w in values.windows(2) {
        let step = w[1] - w[0];
        if step > 0.0 { up += step } else { down -= step }
    }
    f64::min(up, down) < BACK * (up + down)
}

fn looks(
    candidates: &[Candidate],
    judged: &[Option<Judged>],
    noise: &NoiseGains,
    safe: &dyn Fn(&Judged) -> f64,
) -> Vec<Look> {
    let nameless = candidates.iter().zip(judged).filter(|(c, _)| c.family.is_none());
    nameless
        .filter_map(|(c, j)| {
            let j = j.as_ref()?;
            Some(Look {
                basis: c.basis.clone(),
                coefficients: j.gain.beta.as_slice().to_vec(),
                p: noise.p(safe(j)),
            })
        })
        .collect()
}

/// See [`Layer::adequacy`].
const LAW_ADEQUATE: f64 = 0.85;
/// See [`Layer::adequacy`].
const BANDS_ADEQUATE: f64 = 0.45;
/// A name that explains this share of what the best nameless curve does is met by its own shape.
const CLEAR: f64 = 0.85;

/// Views that scatter about a common fit far beyond their noise are explained badly; a name must
/// then help most of them.
fn steady(judged: &Judged) -> bool {
    const WILD: f64 = 3.0;
    const STEADY: f64 = 2.5;
    let none = vec![0.0; judged.gain.by_view.len()];
    judged.null.dispersion < WILD || behind(&judged.gain.by_view, &none) > STEADY
}

/// Mean difference over the views by its standard error.
pub fn behind(winner: &[f64], rival: &[f64]) -> f64 {
    let n = winner.len() as f64;
    let differences = || winner.iter().zip(rival).map(|(w, r)| w - r);
    let mean = differences().sum::<f64>() / n;
    let variance = differences().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    if variance > 0.0 { mean / (variance / n).sqrt() } else { 0.0 }
}

/// A view's response, what is settled taken out.
fn without(view: &ViewData, settled: &[(&Basis, Vec<f64>)]) -> Vec<f64> {
    let mut response = view.response.clone();
    let mut scratch = Vec::new();
    for (basis, beta) in settled {
        for (y, place) in response.iter_mut().zip(&view.places) {
            *y -= basis.value(beta, place, &mut scratch);
        }
    }
    response
}

/// A view's rows with its nuisances and the terms beside.
fn rows(view: &ViewData, response: Vec<f64>, beside: &[&Basis]) -> Option<Rows> {
    let p = view.precision.len();
    let width = p + beside.iter().map(|b| b.count()).sum::<usize>();
    let mut columns = vec![0.0; view.places.len() * width];
    for (i, row) in columns.chunks_exact_mut(width).enumerate() {
        row[..p].copy_from_slice(&view.nuisance[i * p..][..p]);
        let mut rest = &mut row[p..];
        for basis in beside {
            let (mine, others) = rest.split_at_mut(basis.count());
            basis.fill(&view.places[i], mine);
            rest = others;
        }
    }
    Rows::new(response, view.weight.clone(), columns, width, &view.precision)
}

fn prepare<'a>(
    fine: &'a ViewData,
    coarse: &'a ViewData,
    beside: &[&Basis],
    settled: &[(&Basis, Vec<f64>)],
) -> Option<Prepared<'a>> {
    let left = without(fine, settled);
    let left_coarse = if coarse.gathered.is_empty() {
        left.clone()
    } else {
        // What changes within a patch is taken out before the patch is made.
        let mut sums = vec![0.0; coarse.places.len()];
        for ((y, w), &k) in left.iter().zip(&fine.weight).zip(&coarse.gathered) {
            sums[k as usize] += w * y;
        }
        sums.iter().zip(&coarse.weight).map(|(s, w)| if *w > 0.0 { s / w } else { 0.0 }).collect()
    };
    let rows_fine = rows(fine, left, beside)?;
    let places = &fine.places;
    let side = SIDE as f64;
    let groups = vec![
        gather(&rows_fine, places, Coordinate::Column, side),
        gather(&rows_fine, places, Coordinate::Row, side),
        gather(&rows_fine, places, Coordinate::Disparity, DISPARITY_GROUP_PX),
        gather(&rows_fine, places, Coordinate::Edge, EDGE_GROUP_PX),
    ];
    Some(Prepared {
        groups,
        fine: (places, rows_fine),
        coarse: (&coarse.places, rows(coarse, left_coarse, beside)?),
    })
}

/// Disparities this near are one, px: a thirtieth of a locking's period.
const DISPARITY_GROUP_PX: f64 = 1.0 / 30.0;
const EDGE_GROUP_PX: f64 = 0.5;

/// Samples in steps of one coordinate; each group lies where its samples do on average.
fn gather(
    rows: &Rows,
    places: &[PixelContext],
    over: Coordinate,
    step: f64,
) -> (Coordinate, Vec<PixelContext>, Rows) {
    let low = places.iter().map(|p| over.value(p)).fold(f64::INFINITY, f64::min);
    let key = |i: usize| ((over.value(&places[i]) - low) / step) as usize;
    let count = (0..places.len()).map(|i| key(i) + 1).max().unwrap_or(0);
    let mut sums = vec![(PixelContext::default(), [0.0; 6], 0.0); count];
    for (i, p) in places.iter().enumerate() {
        let (first, sum, n) = &mut sums[key(i)];
        *first = *p;
        *n += 1.0;
        let values = [p.u, p.v, p.disparity, p.z, p.edge, p.radius];
        sum.iter_mut().zip(values).for_each(|(s, v)| *s += v);
    }
    let mean = |(place, sum, n): &(PixelContext, [f64; 6], f64)| {
        let [u, v, disparity, z, edge, radius] = sum.map(|s| s / f64::max(*n, 1.0));
        PixelContext { u, v, disparity, z, edge, radius, ..*place }
    };
    (over, sums.iter().map(mean).collect(), rows.grouped(count, key))
}

impl Prepared<'_> {
    fn evidence(&self, basis: &Basis) -> Evidence {
        let alone = basis.alone().and_then(|over| self.groups.iter().find(|g| g.0 == over));
        let (places, rows): (&[PixelContext], &Rows) = if let Some((_, places, rows)) = alone {
            (places, rows)
        } else if basis.is_fine() {
            (self.fine.0, &self.fine.1)
        } else {
            (self.coarse.0, &self.coarse.1)
        };
        rows.reduce(basis.count(), |i, g| basis.fill(&places[i], g))
    }
}

#[cfg(test)]
#[path = "search_tests.rs"]
mod tests;
