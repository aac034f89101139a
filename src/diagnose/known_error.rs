//! What the model knows is not known exactly: where new views differ from it by no more than its own
//! error, nothing is missing.

use std::sync::Arc;

use nalgebra::DVector;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::evidence::Evidence;
use super::known::KnownTerms;
use super::layers::Survey;
use super::null::Null;
use super::rows::Rows;
use super::samples::ViewData;
use super::variance::error_of_sigma;
use crate::model::SigmaModel;
use crate::terms::{PixelContext, Statistic, Term};

/// Chance that a model which is right differs by more than its own error.
const LEVEL: f64 = 1e-3;

/// A part of the model's error: terms that err together, by a standard normal number times these.
type Part = Vec<Term>;

fn value(part: &Part, place: &PixelContext, row: &mut Vec<f64>) -> f64 {
    part.iter().map(|t| t.value(place, row)).sum()
}

/// By how much of each part the views differ from the model: the posterior mean, or, where that is
/// more than the model's error explains, the part of it that its error does. `None` where there is
/// nothing to say.
fn settled(data: &[ViewData], parts: &[Part]) -> Option<Vec<f64>> {
    if parts.is_empty() {
        return None;
    }
    let of = |view: &ViewData| -> Option<Evidence> {
        let width = view.precision.len();
        let rows = Rows::new(&view.response, &view.weight, &view.nuisance, width, &view.precision)?;
        let mut scratch = Vec::new();
        Some(rows.reduce(parts.len(), |i, g| {
            for (g, part) in g.iter_mut().zip(parts) {
                *g = value(part, &view.places[i], &mut scratch);
            }
        }))
    };
    let evidence: Vec<Evidence> = data.par_iter().filter_map(of).collect();
    let n = parts.len();
    let Evidence { a, b } = Evidence::sum(n, 0.0, &evidence);
    // The new views scatter beyond their noise, too.
    let dispersion = Null::of(&evidence, 0, 1.0)?.about_fit;
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
    Some((eigen.eigenvectors * shrunk).as_slice().to_vec())
}

impl Survey {
    /// Take out of the views' means what the model's biases may be off by.
    pub fn forgive_bias(&mut self, known: &KnownTerms) {
        let parts = known.errors(Statistic::Bias);
        let data = self.coarse_mean_data();
        let Some(by) = settled(&data, &parts) else { return };
        self.views.par_iter_mut().for_each(|view| {
            let mut row = Vec::new();
            for t in Arc::make_mut(&mut view.tiles) {
                let of = |(part, by): (&Part, &f64)| by * value(part, &t.place, &mut row);
                let off: f64 = parts.iter().zip(&by).map(of).sum();
                t.square += off * (off - 2.0 * t.mean);
                t.mean -= off;
            }
        });
    }

    /// The same for the size of the noise: sigma's own error and that of known terms.
    pub fn forgive_variance(&mut self, known: &KnownTerms, sigma: &SigmaModel) {
        let mut parts = known.errors(Statistic::Variance);
        parts.extend(error_of_sigma(&self.reach, sigma));
        let data = self.variance_data();
        let Some(by) = settled(&data, &parts) else { return };
        self.views.par_iter_mut().for_each(|view| {
            let mut row = Vec::new();
            for t in Arc::make_mut(&mut view.tiles) {
                let of = |(part, by): (&Part, &f64)| by * value(part, &t.place, &mut row);
                let factor = parts.iter().zip(&by).map(of).sum::<f64>().exp();
                t.variance *= factor;
                t.place.variance *= factor;
            }
        });
    }
}
