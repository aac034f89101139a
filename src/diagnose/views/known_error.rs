//! What the model knows is not known exactly: where new views differ from it by no more than its own
//! error, nothing is missing.

use nalgebra::DVector;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::known::KnownTerms;
use super::layers::Survey;
use super::samples::ViewData;
use crate::diagnose::search::evidence::Evidence;
use crate::diagnose::search::null::Null;
use crate::diagnose::search::variance::error_of_sigma;
use crate::model::SigmaModel;
use crate::terms::{PixelContext, Statistic, Term};

/// Chance that a model which is right differs by more than its own error.
const LEVEL: f64 = 1e-3;

/// What the model may be off by: parts that err together, by a standard normal number times their
/// terms, and terms of which every coefficient errs for itself.
#[derive(Default)]
struct Errors {
    parts: Vec<Vec<Term>>,
    own: Vec<Term>,
}

impl Errors {
    fn of(known: &KnownTerms, statistic: Statistic) -> Self {
        Errors { parts: known.errors(statistic), own: known.own_errors(statistic) }
    }

    fn count(&self) -> usize {
        self.parts.len() + self.own.iter().map(|t| t.coefficients.len()).sum::<usize>()
    }

    fn fill(&self, place: &PixelContext, columns: &mut [f64], row: &mut Vec<f64>) {
        let (together, mut rest) = columns.split_at_mut(self.parts.len());
        together.iter_mut().zip(&self.parts).for_each(|(g, part)| *g = Term::sum(part, place, row));
        for term in &self.own {
            let (mine, others) = rest.split_at_mut(term.coefficients.len());
            term.basis.fill(place, mine);
            mine.iter_mut().zip(&term.coefficients).for_each(|(g, sd)| *g *= sd);
            rest = others;
        }
    }

    /// By how much the views differ from the model along each column: the posterior mean, or, where
    /// that is more than the model's error explains, the part of it that its error does; as terms.
    /// Empty where there is nothing to say.
    fn settled(&self, data: &[ViewData]) -> Vec<Term> {
        let n = self.count();
        let of = |view: &ViewData| -> Option<Evidence> {
            let rows = view.rows(&view.response)?;
            let mut row = Vec::new();
            Some(rows.reduce(n, |i, g| self.fill(&view.places[i], g, &mut row)))
        };
        if n == 0 {
            return Vec::new();
        }
        let evidence: Vec<Evidence> = data.par_iter().filter_map(of).collect();
        nearest(&evidence, n).map_or_else(Vec::new, |by| self.times(by.as_slice()))
    }

    fn times(&self, by: &[f64]) -> Vec<Term> {
        let (together, mut rest) = by.split_at(self.parts.len());
        let scaled = |(part, by): (&Vec<Term>, &f64)| -> Vec<Term> {
            part.iter().map(|t| t.times(*by)).collect()
        };
        let mut terms: Vec<Term> = self.parts.iter().zip(together).flat_map(scaled).collect();
        for term in &self.own {
            let (mine, others) = rest.split_at(term.coefficients.len());
            let coefficients = mine.iter().zip(&term.coefficients).map(|(b, sd)| b * sd).collect();
            terms.push(Term { coefficients, ..term.clone() });
            rest = others;
        }
        terms
    }
}

/// The posterior mean of standard normal numbers, held within what chance gives them.
fn nearest(evidence: &[Evidence], n: usize) -> Option<DVector<f64>> {
    let Evidence { a, b } = Evidence::sum(n, 0.0, evidence);
    // The new views scatter beyond their noise, too.
    let dispersion = Null::of(evidence, 0, 1.0)?.about_fit;
    let (a, b) = (a / dispersion, b / dispersion);
    let eigen = a.symmetric_eigen();
    let along = eigen.eigenvectors.transpose() * b;
    let seen = || along.iter().zip(eigen.eigenvalues.iter()).filter(|(_, l)| **l > 1e-9);
    // A score of information l has the variance l + l^2 where the part itself has that of one.
    let square: f64 = seen().map(|(b, l)| b * b / (l + l * l)).sum();
    let limit = ChiSquared::new(seen().count().max(1) as f64).ok()?.inverse_cdf(1.0 - LEVEL);
    // Of a difference so many times as large as the model's error the rest is the views' own.
    let within = (limit / square.max(limit)).sqrt();
    let shrunk =
        DVector::from_fn(n, |k, _| within * along[k] / (1.0 + eigen.eigenvalues[k].max(0.0)));
    Some(eigen.eigenvectors * shrunk)
}

impl Survey {
    /// Take out of the views' means what the model's biases may be off by.
    pub fn absorb_model_bias_error(&mut self, known: &KnownTerms) {
        let off = Errors::of(known, Statistic::Bias).settled(&self.coarse_mean_data());
        if off.is_empty() {
            return;
        }
        self.views.par_iter_mut().for_each(|view| {
            let mut row = Vec::new();
            for (place, t) in view.tiles_mut() {
                let off = Term::sum(&off, place, &mut row);
                t.square += off * (off - 2.0 * t.mean);
                t.mean -= off;
            }
        });
    }

    /// The same for the size of the noise: sigma's own error and that of known terms.
    pub fn absorb_model_variance_error(&mut self, known: &KnownTerms, sigma: &SigmaModel) {
        let mut errors = Errors::of(known, Statistic::Variance);
        errors.parts.extend(error_of_sigma(&self.reach, sigma));
        let off = errors.settled(&self.variance_data());
        if off.is_empty() {
            return;
        }
        self.views.par_iter_mut().for_each(|view| {
            let mut row = Vec::new();
            for (place, t) in view.patches_mut() {
                let factor = Term::sum(&off, place, &mut row).exp();
                t.variance *= factor;
                place.variance *= factor;
            }
        });
    }
}
