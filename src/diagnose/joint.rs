//! The joint posterior of all that shifts the mean.
//!
//! The search takes the best term first, and what it takes next makes up for what that one got
//! wrong. Here the terms it settled on are fitted together once more, each held by what is usual of
//! its kind, and with them a smooth rest: two maps over the picture, one of them times the square
//! of the disparity. Every view's plane is free, and what planes absorb of a shape is taken out of
//! it beforehand. How smooth the maps are, and whether they and the terms are needed, is decided on
//! views left out.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::candidate::Candidate;
use super::evidence::{Evidence, Gain, Rows, score};
use super::search::{Chosen, Outcome, ViewData, coarser};
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, Gauge, Modulation, Pixels, Statistic, Term};

/// Parts of the views that are left out in turn.
const FOLDS: usize = 6;
/// Precision of second differences of a map's nodes, over the mean information on a node.
const SMOOTHNESS: [f64; 5] = [1.0, 0.2, 0.04, 0.008, 0.0016];
/// Precision of the nodes themselves beside that.
const RIDGE: f64 = 0.1;
/// So much the affine part of a map is held to zero, over the mean information on a node.
const HELD: f64 = 1e4;
/// Pixels to a node of a map.
const NODE_PX: usize = 32;
/// Maps take the place of terms where they predict views left out better by this share, and by so
/// many standard errors over the parts.
const MAPS_SHARE: f64 = 0.02;
const MAPS_CLEARLY: f64 = 3.0;
/// Beside the maps a term must bring this share of all, and be so clear.
const TERM_SHARE: f64 = 0.005;
const TERM_CLEARLY: f64 = 2.0;
/// A shape of the target, which a correction leaves in, must bring as much beside the maps as they
/// must bring themselves, and may be larger than usual by no more than this: what is collinear
/// with the sensor's own error and fits no board is not the board's.
const LARGEST_USUAL: f64 = 3.0;
/// A radial name that explains this share of all stands, and the maps are the rest of it.
const ADEQUATE: f64 = 0.6;

/// What is fitted: terms, then the nodes of the maps.
struct Columns {
    bases: Vec<Basis>,
    gauges: Vec<Option<Gauge>>,
    maps: [Basis; 2],
    /// Columns of the terms, and of both maps.
    terms: usize,
    nodes: usize,
}

impl Columns {
    fn of(chosen: &[Chosen], camera: &Camera) -> Self {
        let rays = camera.rays();
        let pixels = Pixels::new(camera, &rays, 1.0);
        let bases: Vec<Basis> = chosen.iter().map(|c| c.candidate.basis.clone()).collect();
        let [across, down] = [(camera.width, 6, 20), (camera.height, 5, 15)]
            .map(|(length, low, high)| (length / NODE_PX).clamp(low, high));
        let [width, height] = [camera.width, camera.height].map(|n| n as f64);
        let map = |times| Basis::Spline { width, height, across, down, times };
        Columns {
            gauges: bases.iter().map(|b| Gauge::of(b, &pixels)).collect(),
            terms: bases.iter().map(Basis::count).sum(),
            nodes: 2 * across * down,
            bases,
            maps: [map(Modulation::One), map(Modulation::DisparitySquared)],
        }
    }

    /// Normal equations of a view, its plane profiled out.
    fn evidence(&self, view: &ViewData) -> Option<Evidence> {
        let (y, w) = (view.response.clone(), view.weight.clone());
        let rows = Rows::new(y, w, view.nuisance.clone(), view.precision.len(), &view.precision)?;
        Some(rows.reduce(self.terms + self.nodes, |i, row| {
            let place = &view.places[i];
            let mut rest = row;
            for (basis, gauge) in self.bases.iter().zip(&self.gauges) {
                let (mine, others) = rest.split_at_mut(basis.count());
                basis.fill(place, mine);
                if let Some(gauge) = gauge {
                    gauge.take_out(place, mine);
                }
                rest = others;
            }
            let (first, second) = rest.split_at_mut(self.nodes / 2);
            self.maps[0].fill(place, first);
            self.maps[1].fill(place, second);
        }))
    }

    /// Precision of the terms' columns.
    fn usual(&self) -> DVector<f64> {
        let of = |b: &Basis| (0..b.count()).map(|k| b.usual(k).powi(-2)).collect::<Vec<_>>();
        DVector::from_vec(self.bases.iter().flat_map(of).collect())
    }

    fn span(&self, term: usize) -> std::ops::Range<usize> {
        let first: usize = self.bases[..term].iter().map(Basis::count).sum();
        first..first + self.bases[term].count()
    }

    /// What holds the nodes, for a mean information of one on each: smooth, small, and without
    /// what planes absorb.
    fn penalty(&self, camera: &Camera, smoothness: f64) -> DMatrix<f64> {
        let Basis::Spline { across, down, .. } = self.maps[0] else {
            return DMatrix::zeros(0, 0);
        };
        let bend = |n: usize| {
            let d = DMatrix::from_fn(n - 2, n, |i, j| match j.wrapping_sub(i) {
                0 | 2 => 1.0,
                1 => -2.0,
                _ => 0.0,
            });
            d.transpose() * d
        };
        let (id, unit) = (DMatrix::identity(across, across), DMatrix::identity(down, down));
        let rough: DMatrix<f64> = unit.kronecker(&bend(across)) + bend(down).kronecker(&id);
        let n = across * down;
        let mut one = (rough + DMatrix::identity(n, n) * RIDGE) * smoothness;
        let rays = camera.rays();
        if let Some(gauge) = Gauge::of(&self.maps[0], &Pixels::new(camera, &rays, 1.0)) {
            for k in 0..3 {
                let c = DVector::from_iterator(n, gauge.affine.iter().map(|a| a[k])).normalize();
                one.ger(HELD, &c, &c, 1.0);
            }
        }
        let mut both = DMatrix::zeros(2 * n, 2 * n);
        both.view_mut((0, 0), (n, n)).copy_from(&one);
        both.view_mut((n, n), (n, n)).copy_from(&one);
        both
    }
}

/// Some views' equations with the nodes of the maps eliminated, if there are maps.
struct Reduced {
    a: DMatrix<f64>,
    b: DVector<f64>,
    /// The nodes where all terms are nothing, and what a term's coefficient changes of them.
    alone: DVector<f64>,
    with: DMatrix<f64>,
}

impl Reduced {
    fn of(all: &Evidence, terms: usize, penalty: Option<&DMatrix<f64>>) -> Option<Self> {
        let (a, b) = (all.a.view((0, 0), (terms, terms)).into_owned(), all.b.rows(0, terms));
        let nodes = all.b.len() - terms;
        let Some(penalty) = penalty else {
            let (alone, with) = (DVector::zeros(nodes), DMatrix::zeros(nodes, terms));
            return Some(Reduced { a, b: b.into_owned(), alone, with });
        };
        let factor =
            Cholesky::<f64, Dyn>::new(all.a.view((terms, terms), (nodes, nodes)) + penalty)?;
        let cross = all.a.view((terms, 0), (nodes, terms));
        let alone = factor.solve(&all.b.rows(terms, nodes).into_owned());
        let with = factor.solve(&cross.into_owned());
        let less = cross.transpose();
        Some(Reduced { a: a - &less * &with, b: b - less * &alone, alone, with })
    }

    /// Coefficients of the terms' columns in `kept`, and of the nodes.
    fn fit(&self, kept: &[usize], precision: &DVector<f64>) -> Option<DVector<f64>> {
        let n = kept.len();
        let a = DMatrix::from_fn(n, n, |i, j| {
            let own = if i == j { precision[kept[i]] } else { 0.0 };
            self.a[(kept[i], kept[j])] + own
        });
        let mine = a.cholesky()?.solve(&DVector::from_fn(n, |i, _| self.b[kept[i]]));
        let terms = self.b.len();
        let mut all = DVector::zeros(terms + self.alone.len());
        kept.iter().zip(mine.iter()).for_each(|(&k, m)| all[k] = *m);
        let nodes = &self.alone - &self.with * all.rows(0, terms);
        all.rows_mut(terms, self.alone.len()).copy_from(&nodes);
        Some(all)
    }
}

/// The equations by parts of the views.
struct Joint<'a> {
    columns: &'a Columns,
    views: Vec<Vec<usize>>,
    parts: Vec<Evidence>,
    all: Evidence,
    precision: DVector<f64>,
}

fn sum(n: usize, parts: impl Iterator<Item = Evidence>) -> Evidence {
    let none = Evidence { a: DMatrix::zeros(n, n), b: DVector::zeros(n) };
    parts.fold(none, |mut sum, part| {
        sum.a += part.a;
        sum.b += part.b;
        sum
    })
}

impl<'a> Joint<'a> {
    fn of(columns: &'a Columns, data: &[ViewData]) -> Self {
        let n = columns.terms + columns.nodes;
        // Near and far in every part.
        let z = |v: &usize| data[*v].places.first().map_or(0.0, |p| p.rho);
        let mut order: Vec<usize> = (0..data.len()).collect();
        order.sort_by(|a, b| z(a).total_cmp(&z(b)));
        let folds = FOLDS.min(data.len());
        let views: Vec<Vec<usize>> =
            (0..folds).map(|f| order.iter().skip(f).step_by(folds).copied().collect()).collect();
        let parts: Vec<Evidence> = views
            .par_iter()
            .map(|part| sum(n, part.iter().filter_map(|&v| columns.evidence(&data[v]))))
            .collect();
        let all = sum(n, parts.iter().cloned());
        Joint { columns, views, parts, all, precision: columns.usual() }
    }

    /// Fits without each part.
    fn without(&self, penalty: Option<&DMatrix<f64>>) -> Option<Vec<Reduced>> {
        let of = |part: &Evidence| {
            let others = Evidence { a: &self.all.a - &part.a, b: &self.all.b - &part.b };
            Reduced::of(&others, self.columns.terms, penalty)
        };
        self.parts.par_iter().map(of).collect()
    }

    fn kept(&self, terms: &[usize]) -> Vec<usize> {
        terms.iter().flat_map(|&t| self.columns.span(t)).collect()
    }

    /// Nats over no term at all on each part left out; only what `applied` says of a term is taken.
    fn scores(
        &self,
        without: &[Reduced],
        terms: &[usize],
        applied: impl Fn(usize) -> bool + Sync,
    ) -> Vec<f64> {
        let kept = self.kept(terms);
        let of = |(reduced, part): (&Reduced, &Evidence)| {
            let mut beta = reduced.fit(&kept, &self.precision)?;
            for &t in terms.iter().filter(|t| !applied(**t)) {
                self.columns.span(t).for_each(|k| beta[k] = 0.0);
            }
            Some(score(part, &beta))
        };
        let pairs: Vec<_> = without.iter().zip(&self.parts).collect();
        pairs.into_par_iter().map(|pair| of(pair).unwrap_or(f64::NEG_INFINITY)).collect()
    }
}

fn total(scores: &[f64]) -> f64 {
    scores.iter().sum()
}

/// Mean of the differences over its standard error.
fn clearly(better: &[f64], than: &[f64]) -> f64 {
    let n = better.len() as f64;
    let differences = || better.iter().zip(than).map(|(a, b)| a - b);
    let mean = differences().sum::<f64>() / n;
    let variance = differences().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    mean / (variance / n).sqrt().max(f64::MIN_POSITIVE)
}

/// Do the maps say the same, and more?
fn is_smooth_and_nameless(c: &Candidate) -> bool {
    let still = matches!(
        c.basis,
        Basis::Map { .. } | Basis::Curve { over: Coordinate::Radius, nodes: 3.., .. }
    );
    c.family.is_none() && still
}

fn is_radial_name(c: &Candidate) -> bool {
    c.family.is_some()
        && matches!(c.basis, Basis::Bowl { .. } | Basis::Lens { .. } | Basis::RangeNotDepth)
}

/// Can a smooth map stand in for it at all?
fn is_rough(c: &Candidate) -> bool {
    let fine_lines = matches!(
        c.basis,
        Basis::Curve { over: Coordinate::Column | Coordinate::Row, nodes: 2 | 30.., .. }
    );
    c.basis.is_fine() || fine_lines || matches!(c.basis, Basis::Banding { .. })
}

fn is_of_sensor(c: &Candidate) -> bool {
    let basis = c.basis.clone();
    Term { statistic: Statistic::Bias, basis, coefficients: Vec::new() }.is_sensor_bias()
}

/// What the terms are in the end.
struct Settled {
    terms: Vec<usize>,
    penalty: Option<DMatrix<f64>>,
    without: Vec<Reduced>,
    scores: Vec<f64>,
    /// What the maps bring beside the terms, nats.
    maps: f64,
}

impl Joint<'_> {
    fn settle(&self, chosen: &[Chosen], camera: &Camera) -> Option<Settled> {
        let everything: Vec<usize> = (0..chosen.len()).collect();
        let plain = self.without(None)?;
        let scores = self.scores(&plain, &everything, |_| true);
        let mut settled =
            Settled { scores, terms: everything, penalty: None, without: plain, maps: 0.0 };
        let is_kept = |t: &usize| !is_smooth_and_nameless(&chosen[*t].candidate);
        let kept: Vec<usize> = settled.terms.iter().copied().filter(is_kept).collect();
        if let Some(mapped) = self.best_maps(&kept, camera) {
            let better = total(&mapped.scores) - total(&settled.scores);
            let slack = MAPS_SHARE * total(&mapped.scores);
            let clear = clearly(&mapped.scores, &settled.scores) > MAPS_CLEARLY;
            // A rest that the search saw is told by the maps, unless they are the worse for it.
            let seen = kept.len() < settled.terms.len();
            if (clear && better > slack) || (seen && better > -slack) {
                let alone = total(&self.scores(&settled.without, &kept, |_| true));
                settled = mapped;
                self.drop_idle(&mut settled, chosen, alone);
                settled.maps = total(&settled.scores) - alone;
            }
        }
        self.drop_harmful(&mut settled, chosen);
        Some(settled)
    }

    /// As smooth as predicts the parts left out best.
    fn best_maps(&self, terms: &[usize], camera: &Camera) -> Option<Settled> {
        let first = self.columns.terms;
        let diagonal = self.all.a.diagonal();
        let unit = diagonal.rows(first, self.columns.nodes / 2).mean();
        let mut best: Option<Settled> = None;
        for smoothness in SMOOTHNESS {
            let penalty = self.columns.penalty(camera, smoothness) * unit;
            let Some(without) = self.without(Some(&penalty)) else { continue };
            let scores = self.scores(&without, terms, |_| true);
            if best.as_ref().is_some_and(|b| total(&b.scores) > total(&scores)) {
                break;
            }
            let (terms, penalty) = (terms.to_vec(), Some(penalty));
            best = Some(Settled { terms, penalty, without, scores, maps: 0.0 });
        }
        best
    }

    /// Terms that the maps make needless, the most needless first.
    fn drop_idle(&self, settled: &mut Settled, chosen: &[Chosen], alone: f64) {
        loop {
            let all = total(&settled.scores);
            let named = alone > ADEQUATE * all;
            let idle = |&t: &usize| {
                let c = &chosen[t].candidate;
                if is_rough(c) || (named && is_radial_name(c)) {
                    return None;
                }
                let others: Vec<usize> =
                    settled.terms.iter().copied().filter(|o| *o != t).collect();
                let scores = self.scores(&settled.without, &others, |_| true);
                let lost = all - total(&scores);
                let of_target = !is_of_sensor(c);
                let share = if of_target { MAPS_SHARE } else { TERM_SHARE };
                let needed = lost > share * all && clearly(&settled.scores, &scores) > TERM_CLEARLY;
                let believed = !of_target || self.size(settled, t) < LARGEST_USUAL;
                (!(needed && believed)).then_some((lost, others, scores))
            };
            let next = settled.terms.iter().filter_map(idle).min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, others, scores)) = next else { return };
            (settled.terms, settled.scores) = (others, scores);
        }
    }

    /// The largest of a term's coefficients over its usual size, mean over the fits.
    fn size(&self, settled: &Settled, term: usize) -> f64 {
        let kept = self.kept(&settled.terms);
        let span = self.columns.span(term);
        let of = |beta: DVector<f64>| -> f64 {
            span.clone().map(|k| self.precision[k].sqrt() * beta[k].abs()).fold(0.0, f64::max)
        };
        let fits = settled.without.iter().filter_map(|r| r.fit(&kept, &self.precision));
        fits.map(of).sum::<f64>() / settled.without.len().max(1) as f64
    }

    /// What a correction takes out must help the parts left out; terms that are needed for the sum
    /// alone, against one that is not the sensor's, do not.
    fn drop_harmful(&self, settled: &mut Settled, chosen: &[Chosen]) {
        let of_sensor = |t: usize| is_of_sensor(&chosen[t].candidate);
        while !settled.terms.is_empty() {
            if total(&self.scores(&settled.without, &settled.terms, of_sensor)) >= 0.0 {
                return;
            }
            let without = |&t: &usize| {
                let others: Vec<usize> =
                    settled.terms.iter().copied().filter(|o| *o != t).collect();
                (total(&self.scores(&settled.without, &others, of_sensor)), others)
            };
            let best = settled.terms.iter().map(without).max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, others)) = best else { return };
            settled.scores = self.scores(&settled.without, &others, |_| true);
            settled.terms = others;
        }
    }
}

/// The terms of a finished search fitted together, with the smooth rest. `fine` are the views' means
/// in small patches, `inflation` what each view's weights were divided by: a bias is as sure in a
/// view as in another, for views scatter beyond their noise.
pub fn refit(fine: &[ViewData], inflation: &[f64], camera: &Camera, found: Outcome) -> Outcome {
    if found.chosen.is_empty() {
        return found;
    }
    let rough = found.chosen.iter().any(|c| is_rough(&c.candidate));
    let common = median(inflation);
    let data: Vec<ViewData> = fine
        .par_iter()
        .zip(inflation)
        .map(|(view, own)| {
            let mut view = if rough { view.clone() } else { coarser(view) };
            view.weight.iter_mut().for_each(|w| *w *= own / common);
            view
        })
        .collect();
    let columns = Columns::of(&found.chosen, camera);
    let joint = Joint::of(&columns, &data);
    match joint.settle(&found.chosen, camera) {
        Some(settled) => joint.posterior(&data, &settled, &found).unwrap_or(found),
        None => found,
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(1.0)
}

impl Joint<'_> {
    fn posterior(&self, data: &[ViewData], s: &Settled, found: &Outcome) -> Option<Outcome> {
        let kept = self.kept(&s.terms);
        let whole = Reduced::of(&self.all, self.columns.terms, s.penalty.as_ref())?;
        let first = whole.fit(&kept, &self.precision)?;
        // What every view says of the terms beyond the common fit.
        let beyond: Vec<DVector<f64>> = data
            .par_iter()
            .filter_map(|view| {
                let Evidence { a, b } = self.columns.evidence(view)?;
                let left = b - a * &first;
                let terms = self.columns.terms;
                let nodes = left.rows(terms, self.columns.nodes);
                let mine = left.rows(0, terms) - whole.with.transpose() * nodes;
                Some(DVector::from_fn(kept.len(), |i, _| mine[kept[i]]))
            })
            .collect();
        let information =
            DMatrix::from_fn(kept.len(), kept.len(), |i, j| whole.a[(kept[i], kept[j])]);
        let held = |dispersion: f64| {
            let own = DVector::from_fn(kept.len(), |i, _| dispersion * self.precision[kept[i]]);
            (&information + DMatrix::from_diagonal(&own)).try_inverse()
        };
        let inverse = held(1.0)?;
        let free = (&information * &inverse).trace();
        let scatter: f64 = beyond.iter().map(|e| e.dot(&(&inverse * e))).sum();
        // Views scatter beyond their noise: what they say counts for less against what is usual.
        let dispersion = if kept.is_empty() { 1.0 } else { (scatter / free).max(1.0) };
        let precision = &self.precision * dispersion;
        let beta = whole.fit(&kept, &precision)?;
        let errors = clustered(&held(dispersion)?, &beyond);
        let mut outcome = Outcome {
            chosen: self.chosen(s, found),
            looks: found.looks.clone(),
            fit: None,
            evidence: Vec::new(),
            noise: found.noise.clone(),
            remaining: found
                .remaining
                .clone()
                .filter(|r| s.penalty.is_none() || !is_smooth_and_nameless(&r.candidate)),
            left_out: Vec::new(),
        };
        let folds = s.without.iter().zip(&self.views);
        outcome.left_out = folds
            .filter_map(|(r, views)| {
                Some((views.clone(), self.told(s, &r.fit(&kept, &precision)?)))
            })
            .collect();
        let told = self.told(s, &beta);
        let mut covariance = DMatrix::zeros(told.len(), told.len());
        let mut to = 0;
        let places: Vec<usize> = s
            .terms
            .iter()
            .flat_map(|&t| {
                let (count, gauge) = (self.columns.bases[t].count(), &self.columns.gauges[t]);
                let first = to;
                to += count + if gauge.is_some() { 3 } else { 0 };
                first..first + count
            })
            .collect();
        for (i, &p) in places.iter().enumerate() {
            for (j, &q) in places.iter().enumerate() {
                covariance[(p, q)] = errors[(i, j)];
            }
        }
        outcome.fit = Some(Gain {
            total: total(&s.scores),
            by_view: s.scores.clone(),
            beta: DVector::from_vec(told),
            covariance,
        });
        Some(outcome)
    }

    /// The terms with what planes absorb of each, and the maps.
    fn chosen(&self, s: &Settled, found: &Outcome) -> Vec<Chosen> {
        let mut chosen = Vec::new();
        for &t in &s.terms {
            let term = &found.chosen[t];
            chosen.push(term.clone());
            if let Some(gauge) = &self.columns.gauges[t] {
                let (basis, _) = gauge.term(&[]);
                let candidate = Candidate { family: term.candidate.family, basis };
                chosen.push(Chosen { candidate, gain: 0.0, rivals: Vec::new(), ..term.clone() });
            }
        }
        if s.penalty.is_some() {
            for (basis, gain) in self.columns.maps.iter().zip([s.maps, 0.0]) {
                chosen.push(Chosen {
                    candidate: Candidate::curve(basis.clone()),
                    rms: 0.0,
                    adequacy: 0.0,
                    gain,
                    best_curve: gain,
                    rivals: Vec::new(),
                    p: found.noise.p(s.maps),
                });
            }
        }
        chosen
    }

    /// The coefficients of [`Joint::chosen`].
    fn told(&self, s: &Settled, beta: &DVector<f64>) -> Vec<f64> {
        let mut told = Vec::new();
        for &t in &s.terms {
            let mine = &beta.as_slice()[self.columns.span(t)];
            told.extend(mine);
            if let Some(gauge) = &self.columns.gauges[t] {
                told.extend(gauge.term(mine).1);
            }
        }
        if s.penalty.is_some() {
            told.extend(beta.rows(self.columns.terms, self.columns.nodes).iter());
        }
        told
    }
}

/// Covariance with the views as the sample (White 1980; Liang and Zeger 1986), where it is the larger.
fn clustered(inverse: &DMatrix<f64>, beyond: &[DVector<f64>]) -> DMatrix<f64> {
    let n = beyond.len() as f64;
    let mut square = DMatrix::zeros(inverse.nrows(), inverse.nrows());
    for e in beyond {
        let moved = inverse * e;
        square.ger(n / (n - 1.0).max(1.0), &moved, &moved, 1.0);
    }
    let larger: Vec<f64> =
        (0..inverse.nrows()).map(|i| (square[(i, i)] / inverse[(i, i)]).max(1.0).sqrt()).collect();
    DMatrix::from_fn(inverse.nrows(), inverse.nrows(), |i, j| {
        inverse[(i, j)] * larger[i] * larger[j]
    })
}

#[cfg(test)]
#[path = "joint_tests.rs"]
mod tests;
