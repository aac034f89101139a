//! Joint posterior of everything that shifts the mean.
//!
//! The search takes the best term first, and later terms make up for its errors. Here the terms found
//! are refitted jointly, each with a prior on its usual size, together with a smooth remainder: two
//! maps over the image, one of them times the square of the disparity. Every view's plane is free, and
//! what planes absorb of a shape is subtracted beforehand. Left-out views decide how smooth the maps
//! are, and whether they and the terms are needed.

pub mod anchor;
mod columns;
pub mod error;
pub mod fit;
pub mod terms;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::camera::Camera;
use crate::diagnose::checks::replication::{Half, Halves, spans};
use crate::diagnose::search::candidate::Candidate;
use crate::diagnose::search::evidence::Gain;
use crate::diagnose::search::outcome::{Chosen, Outcome};
use crate::diagnose::views::samples::{COARSE_PX, ViewData, coarser};
use crate::terms::Gauge;
use columns::Columns;
use error::clustered;
use fit::{Joint, Reduced};
use terms::{Settled, System, total};

/// Refits the terms of a finished search jointly, with the smooth remainder. `fine` are the views'
/// means in small patches. `inflation` is what each view's weights were divided by; it is replaced by
/// its median, because views scatter beyond their noise and a bias is equally certain in all. `second`
/// says which half a view is in; if all are in one half, halves and covariance are not computed.
pub fn refit(
    fine: &[ViewData],
    inflation: &[f64],
    second: &[bool],
    camera: &Camera,
    found: Outcome,
) -> Outcome {
    if found.chosen.is_empty() {
        return found;
    }
    let rough = found.chosen.iter().any(|c| c.candidate.is_rough());
    let common = median(inflation);
    let data: Vec<ViewData> = fine
        .par_iter()
        .zip(inflation)
        .map(|(view, own)| {
            let mut view = if rough { view.clone() } else { coarser(view, COARSE_PX) };
            // A target too small to measure its noise on has no weight already.
            let share = if own.is_finite() { own / common } else { 0.0 };
            view.weight.iter_mut().for_each(|w| *w *= share);
            view
        })
        .collect();
    let weight = data.iter().flat_map(|view| &view.weight).sum();
    let columns = Columns::of(&found.chosen, camera, weight);
    let joint = Joint::of(&columns, &data, second);
    match joint.settle(&found.chosen) {
        Some(settled) => joint.posterior(second, &settled, &found, camera).unwrap_or(found),
        None => found,
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(1.0)
}

impl Joint<'_> {
    fn posterior(
        &self,
        second: &[bool],
        s: &Settled,
        found: &Outcome,
        camera: &Camera,
    ) -> Option<Outcome> {
        let kept = self.kept(&s.terms);
        let whole = Reduced::of(&self.all, self.columns.terms, &kept, s.penalty.as_ref())?;
        let first = whole.fit(&kept, &self.columns.precision)?;
        // Scores that the common fit leaves in each view, of all columns and of the terms alone.
        let every: Vec<usize> = (0..self.data.len()).collect();
        let left = self.left(&every, &first);
        let of_terms = |left: &DVector<f64>| {
            let terms = self.columns.terms;
            let nodes = left.rows(terms, self.columns.nodes);
            let mine = left.rows(0, terms) - whole.with.transpose() * nodes;
            DVector::from_fn(kept.len(), |i, _| mine[kept[i]])
        };
        let beyond: Vec<DVector<f64>> = left.iter().map(of_terms).collect();
        let information =
            DMatrix::from_fn(kept.len(), kept.len(), |i, j| whole.a[(kept[i], kept[j])]);
        let held = |dispersion: f64| {
            let own =
                DVector::from_fn(kept.len(), |i, _| dispersion * self.columns.precision[kept[i]]);
            (&information + DMatrix::from_diagonal(&own)).try_inverse()
        };
        let inverse = held(1.0)?;
        let free = (&information * &inverse).trace();
        let scatter: f64 = beyond.iter().map(|e| e.dot(&(&inverse * e))).sum();
        // Views scatter beyond their noise, so their evidence counts less against the prior.
        let dispersion = if kept.is_empty() { 1.0 } else { (scatter / free).max(1.0) };
        let precision = &self.columns.precision * dispersion;
        let beta = whole.fit(&kept, &precision)?;
        let inverse = held(dispersion)?;
        // A parameter errs by its posterior. A name is lost by what the estimate scatters by, which the prior
        // makes less.
        let errors = clustered(&inverse, dispersion, &beyond);
        let scattered = clustered(&inverse, 1.0, &beyond);
        let planes = (camera, far_to_near(self.data));
        let is_told = second.contains(&true);
        let (halves, error) = rayon::join(
            || is_told.then(|| self.halves(second, s, &precision, &beta)).flatten(),
            || is_told.then(|| self.error(s, &kept, &precision, &left, planes)).flatten(),
        );
        let told = self.reported(s, &beta);
        let fit = Gain {
            total: total(&s.scores),
            by_view: s.scores.clone(),
            covariance: self.covariance_of_reported(s, &errors, told.len()),
            beta: DVector::from_vec(told),
        };
        let disagreed = if is_told { self.disagreed(s, &beta, &scattered) } else { Vec::new() };
        Some(Outcome {
            chosen: self.chosen(s, found, &disagreed),
            looks: found.looks.clone(),
            noise: found.noise.clone(),
            halves,
            covariance: error.unwrap_or_default(),
            fit: Some(fit),
            ..Outcome::default()
        })
    }

    /// The terms' covariance, laid out like the coefficients of [`Joint::reported`]; zero elsewhere.
    fn covariance_of_reported(
        &self,
        s: &Settled,
        errors: &DMatrix<f64>,
        told: usize,
    ) -> DMatrix<f64> {
        let (mut covariance, mut to) = (errors.clone(), 0);
        for &t in &s.terms {
            to += self.columns.bases[t].count();
            if self.columns.gauges[t].is_some() {
                covariance = covariance.insert_rows(to, 3, 0.0).insert_columns(to, 3, 0.0);
                to += 3;
            }
        }
        covariance.resize(told, told, 0.0)
    }

    /// Fits the same system to each half of the views.
    fn halves(
        &self,
        second: &[bool],
        s: &Settled,
        precision: &DVector<f64>,
        whole: &DVector<f64>,
    ) -> Option<Halves> {
        let kept = self.kept(&s.terms);
        let System { columns, held } = self.system(s, &kept, precision);
        let n = columns.len();
        let part = |a: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| a[(columns[i], columns[j])]);
        let own = |all: &DVector<f64>| DVector::from_fn(n, |i, _| all[columns[i]]);
        let half = |which: bool| {
            let evidence = &self.halves[usize::from(which)];
            Half::of(part(&evidence.a) + &held, &own(&evidence.b), |beta| {
                let mut all = DVector::zeros(self.all.b.len());
                columns.iter().zip(beta.iter()).for_each(|(&c, b)| all[c] = *b);
                let mine: Vec<usize> = (0..second.len()).filter(|v| second[*v] == which).collect();
                self.left(&mine, &all).iter().map(own).collect()
            })
        };
        let mut counts = Vec::new();
        for &t in &s.terms {
            counts.push(self.columns.bases[t].count());
            // The part that planes absorb belongs to its term.
            counts.extend(self.columns.gauges[t].is_some().then_some(0));
        }
        if s.penalty.is_some() {
            counts.extend([self.columns.nodes / 2; 2]);
            counts.extend(self.columns.far_gauge.is_some().then_some(0));
        }
        Some(Halves {
            metric: part(&self.all.a),
            whole: own(whole),
            halves: [half(false)?, half(true)?],
            spans: spans(&counts),
        })
    }

    /// The terms, each with the part that planes absorb, and the maps. A term that the views disagree
    /// on entirely loses its name.
    fn chosen(&self, s: &Settled, found: &Outcome, disagreed: &[usize]) -> Vec<Chosen> {
        let mut chosen = Vec::new();
        for &t in &s.terms {
            let mut term = found.chosen[t].clone();
            if disagreed.contains(&t) {
                term.candidate = Candidate::curve(term.candidate.basis);
            }
            chosen.push(term.clone());
            if let Some(gauge) = &self.columns.gauges[t] {
                let (basis, _) = gauge.term(&[]);
                let candidate = Candidate { basis, ..term.candidate.clone() };
                chosen.push(Chosen { candidate, gain: 0.0, rivals: Vec::new(), ..term.clone() });
            }
        }
        if s.penalty.is_some() {
            for (basis, gain) in self.columns.rest().zip([s.maps, 0.0, 0.0]) {
                let map = Chosen::of(Candidate::curve(basis));
                chosen.push(Chosen { gain, best_curve: gain, p: s.maps_p, ..map });
            }
        }
        chosen
    }

    /// The coefficients of [`Joint::chosen`].
    fn reported(&self, s: &Settled, beta: &DVector<f64>) -> Vec<f64> {
        self.laid_out(s, beta, |gauge, mine| gauge.term(mine).1)
    }

    /// Lays out one number per coefficient of [`Joint::chosen`]; `affine` gives those of the parts that
    /// planes absorb.
    fn laid_out(
        &self,
        s: &Settled,
        of_columns: &DVector<f64>,
        affine: impl Fn(&Gauge, &[f64]) -> [f64; 3],
    ) -> Vec<f64> {
        let mut told = Vec::new();
        for &t in &s.terms {
            let mine = &of_columns.as_slice()[self.columns.span(t)];
            told.extend(mine);
            if let Some(gauge) = &self.columns.gauges[t] {
                told.extend(affine(gauge, mine));
            }
        }
        if s.penalty.is_some() {
            let nodes = &of_columns.as_slice()[self.columns.terms..];
            told.extend(nodes);
            if let Some(gauge) = &self.columns.far_gauge {
                told.extend(affine(gauge, &nodes[self.columns.nodes / 2..]));
            }
        }
        told
    }
}

/// Disparity, px, and depth, m, far, middle and near: the 10 %, 50 % and 90 % quantiles of the views' samples.
fn far_to_near(data: &[ViewData]) -> [[f64; 2]; 3] {
    let places = data.iter().flat_map(|v| v.places.iter());
    let mut all: Vec<[f64; 2]> = places.map(|p| [p.disparity, p.z]).collect();
    all.par_sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    [0.1, 0.5, 0.9]
        .map(|share| all.get((share * all.len() as f64) as usize).copied().unwrap_or([1.0; 2]))
}

#[cfg(test)]
mod tests;
