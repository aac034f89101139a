//! The model's own uncertainty: differences of new views that it explains are no missing effects.

use nalgebra::{DVector, Vector3};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::known::KnownTerms;
use super::layers::Survey;
use super::samples::ViewData;
use super::surveyed_view::SurveyedView;
use crate::diagnose::search::evidence::Evidence;
use crate::diagnose::search::null::Null;
use crate::diagnose::search::variance::error_of_sigma;
use crate::model::{Domain, SigmaModel};
use crate::terms::{PixelContext, Statistic, Term};

/// Probability that a correct model differs by more than its own error.
const LEVEL: f64 = 1e-3;

/// Least share of the views worth a remark, percent.
const TELLABLE_PERCENT: f64 = 0.5;

/// Uncertainty of the model: `parts` err together, each by a standard normal number times its terms; in `own`
/// each coefficient errs independently.
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

    fn fill(&self, place: &PixelContext, columns: &mut [f64]) {
        let (together, mut rest) = columns.split_at_mut(self.parts.len());
        together.iter_mut().zip(&self.parts).for_each(|(g, part)| *g = Term::sum(part, place));
        for term in &self.own {
            let (mine, others) = rest.split_at_mut(term.coefficients.len());
            term.basis.fill(place, mine);
            mine.iter_mut().zip(&term.coefficients).for_each(|(g, sd)| *g *= sd);
            rest = others;
        }
    }

    /// Difference of the views from the model along each column, as terms: the posterior mean, scaled down
    /// where it exceeds what the model's error explains. Empty without errors or evidence.
    fn settled(&self, data: &[ViewData]) -> Vec<Term> {
        let n = self.count();
        let of = |view: &ViewData| -> Option<Evidence> {
            let rows = view.rows(&view.response)?;
            Some(rows.reduce(n, |i, g| self.fill(&view.places[i], g)))
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

/// Posterior mean of standard normal coefficients, limited to what chance gives them.
fn nearest(evidence: &[Evidence], n: usize) -> Option<DVector<f64>> {
    let Evidence { a, b } = Evidence::sum(n, 0.0, evidence);
    // The new views also scatter beyond their noise.
    let dispersion = Null::of(evidence, 0, 1.0)?.about_fit;
    let (a, b) = (a / dispersion, b / dispersion);
    let eigen = a.symmetric_eigen();
    let along = eigen.eigenvectors.transpose() * b;
    let seen = || along.iter().zip(eigen.eigenvalues.iter()).filter(|(_, l)| **l > 1e-9);
    // A score with information l has the variance l + l^2 if the coefficient has unit variance.
    let square: f64 = seen().map(|(b, l)| b * b / (l + l * l)).sum();
    let limit = ChiSquared::new(seen().count().max(1) as f64).ok()?.inverse_cdf(1.0 - LEVEL);
    // The excess over the model's error is the views' own.
    let within = (limit / square.max(limit)).sqrt();
    let shrunk =
        DVector::from_fn(n, |k, _| within * along[k] / (1.0 + eigen.eigenvalues[k].max(0.0)));
    Some(eigen.eigenvectors * shrunk)
}

/// Error of sigma, in log variance, that brings less than 2 nats if it is in a part of every view. The
/// tiles of a long recording weigh a million (18 views of 4 frames of 640 x 480 weigh two and a half
/// million).
const UNSEEN: f64 = 0.002;

/// Whether a place is so far outside the model's domain that sigma, held at the domain's edge, visibly
/// differs from the continuation of its form. The model says nothing of the noise there.
pub fn is_beyond(sigma: &SigmaModel, z: f64, theta: f64) -> bool {
    let log_variance = 2.0 * sigma.ln_beyond_domain(z, theta);
    // NaN: the form cannot be continued there.
    log_variance.is_nan() || log_variance.abs() > UNSEEN
}

impl Survey {
    /// Drops the measured noise where the model says nothing of it.
    pub fn forget_noise_beyond(&mut self, sigma: &SigmaModel) {
        for (place, t) in self.views.iter_mut().flat_map(SurveyedView::tiles_mut) {
            if is_beyond(sigma, place.z, place.theta) {
                t.temporal = f64::NAN;
            }
        }
    }

    /// Remark on what [`Survey::forget_noise_beyond`] left out.
    pub fn noise_untested(&self, sigma: &SigmaModel) -> Option<String> {
        let places = || self.views.iter().flat_map(|v| v.places.iter());
        let beyond = places().filter(|p| is_beyond(sigma, p.z, p.theta)).count();
        let percent = 100.0 * beyond as f64 / places().count().max(1) as f64;
        let Domain { z_m: [near, far], theta_rad: [_, steepest] } = sigma.domain;
        (percent > TELLABLE_PERCENT).then(|| {
            format!(
                "the model's sigma was measured from {near:.2} to {far:.2} m and up to {:.0} degrees of tilt: the size of the noise was not tested in the {percent:.0} % of these views that lie beyond",
                steepest.to_degrees()
            )
        })
    }

    /// Subtracts from the views' means what the uncertainty of the model's biases explains. Each view keeps its
    /// plane, which the means do not determine and which is compared with the reference distances.
    pub fn absorb_model_bias_error(&mut self, known: &KnownTerms) {
        let off = Errors::of(known, Statistic::Bias).settled(&self.coarse_mean_data());
        if off.is_empty() {
            return;
        }
        self.views.par_iter_mut().for_each(|view| absorb(view, &off));
    }

    /// Same for the size of the noise: the uncertainty of sigma and of known terms.
    pub fn absorb_model_variance_error(&mut self, known: &KnownTerms, sigma: &SigmaModel) {
        let mut errors = Errors::of(known, Statistic::Variance);
        errors.parts.extend(error_of_sigma(&self.reach, sigma));
        let off = errors.settled(&self.variance_data());
        if off.is_empty() {
            return;
        }
        self.views.par_iter_mut().for_each(|view| {
            for (place, t) in view.patches_mut() {
                let factor = Term::sum(&off, place).exp();
                t.noise_variance *= factor;
                place.variance *= factor;
            }
        });
    }
}

/// Subtracts the terms from a view's means, without the plane through them.
fn absorb(view: &mut SurveyedView, terms: &[Term]) {
    let mut off: Vec<f64> = view.places.iter().map(|p| Term::sum(terms, p)).collect();
    if let Some(plane) = view.plane_through(off.iter().copied()) {
        let on_plane = view.places.iter().map(|p| plane.dot(&Vector3::new(1.0, p.x, p.y)));
        off.iter_mut().zip(on_plane).for_each(|(off, plane)| *off -= plane);
    }
    for ((_, t), off) in view.tiles_mut().zip(off) {
        t.square += off * (off - 2.0 * t.mean);
        t.mean -= off;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::views::tiles::Tile;
    use crate::terms::{Basis, Coordinate, Modulation};

    /// Eq. 1 is held constant below 1 m: the variance is too large by a thousandth at 0.9995 m and by a
    /// fiftieth at 0.99 m. Beyond the form's pole it is undefined.
    #[test]
    fn a_model_says_nothing_where_its_edge_is_not_its_form() {
        let beyond = |z, theta| is_beyond(&SigmaModel::paper(), z, theta);
        assert_eq!([4.0, 1.0, 0.9995, 0.99].map(|z| beyond(z, 0.3)), [false, false, false, true]);
        assert!(!beyond(2.0, 1.3) && beyond(2.0, 1.4));
    }

    /// A bowl on a target that reaches to one corner: its means lose the bowl, and keep their plane.
    #[test]
    fn a_view_keeps_its_plane_beside_the_error_of_a_bias() {
        let basis = Basis::powers(Coordinate::RadiusSquared, 1, Modulation::One);
        let bowl = [Term::bias(basis, vec![0.4])];
        let patches = (0..400).map(|k| {
            let [x, y] = [k % 20, k / 20].map(|at| 0.02 * f64::from(at) - 0.1);
            let place = PixelContext { x, y, radius: x.hypot(y), ..PixelContext::default() };
            let mean = 0.3 - 0.2 * x + Term::sum(&bowl, &place);
            (place, Tile { mean, pixels: 16.0, ..Tile::of_noise(1.0, 16.0) })
        });
        let mut view = SurveyedView::white(patches, 1.0);
        let before = view.plane_through(view.tiles.iter().map(|t| t.mean)).expect("a plane");
        absorb(&mut view, &bowl);
        for (PixelContext { x, y, .. }, Tile { mean, .. }) in view.patches() {
            let on_plane = before.dot(&Vector3::new(1.0, *x, *y));
            assert!((mean - on_plane).abs() < 1e-12, "{x}, {y}: {mean}, {on_plane}");
        }
        assert!((before[0] - 0.3).abs() > 1e-4, "the bowl has a level of its own: {before}");
    }
}
