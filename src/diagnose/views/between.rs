//! Scatter of a term from view to view: a random effect of the views, by restricted maximum likelihood.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::samples::ViewData;
use crate::diagnose::search::evidence::Evidence;
use crate::terms::{Basis, PixelContext, Term};

/// Rounds of the expectation-maximisation; it starts at a scatter as large as the terms.
const ROUNDS: usize = 200;
/// A scatter below this share of a term counts as none: what noise leaves of it after so many rounds.
const NONE: f64 = 0.02;

/// No scatter is stated where the posterior variance of the sizes exceeds this share of it.
const UNTOLD: f64 = 0.9;

/// Standard deviation of each term's size between views, as a share of it. `views` are the data that the
/// terms were fitted to.
pub fn between(views: &[ViewData], terms: &[Term]) -> Vec<f64> {
    let evidence: Vec<Evidence> = views.par_iter().filter_map(|v| of_view(v, terms)).collect();
    let shares = scatter(&evidence, terms.len());
    let told = |(share, term): (&f64, &Term)| {
        // Planes absorb an affine part, whatever its size.
        let seen = *share > NONE && !matches!(term.basis, Basis::Affine { .. });
        if seen { (1e3 * share).round() / 1e3 } else { 0.0 }
    };
    shares.iter().zip(terms).map(told).collect()
}

/// Evidence of a view on the deviations of the terms' sizes from their common one.
fn of_view(view: &ViewData, terms: &[Term]) -> Option<Evidence> {
    let sizes =
        |place: &PixelContext| -> Vec<f64> { terms.iter().map(|t| t.value(place)).collect() };
    let columns: Vec<Vec<f64>> = view.places.iter().map(sizes).collect();
    let rest = view.response.iter().zip(&columns).map(|(y, g)| y - g.iter().sum::<f64>());
    let rest: Vec<f64> = rest.collect();
    let rows = view.rows(&rest)?;
    let evidence = rows.reduce(terms.len(), |i, g| g.copy_from_slice(&columns[i]));
    let finite = evidence.a.iter().chain(&evidence.b).all(|x| x.is_finite());
    finite.then_some(evidence)
}

/// Root of the diagonal T for sizes s ~ N(0, T), observed as b ~ N(A s, A) (Laird and Ware 1982). The common
/// size was fitted to these views, which takes one degree of freedom.
fn scatter(views: &[Evidence], terms: usize) -> Vec<f64> {
    let n = views.len() as f64;
    if n < 3.0 {
        return vec![0.0; terms];
    }
    let mut variance = DVector::from_element(terms, 1.0);
    let mut unseen = DVector::zeros(terms);
    for _ in 0..ROUNDS {
        let held = DMatrix::from_diagonal(&variance.map(|t: f64| 1.0 / t.max(f64::MIN_POSITIVE)));
        let mut seen = DVector::zeros(terms);
        unseen.fill(0.0);
        for view in views {
            let Some(factor) = (&view.a + &held).cholesky() else { return vec![0.0; terms] };
            let posterior = factor.inverse();
            let mean = &posterior * &view.b;
            seen += mean.component_mul(&mean) / n;
            unseen += posterior.diagonal() / n;
        }
        variance = seen + &unseen;
    }
    // No view measures the part of a shape that planes absorb.
    let told = |(t, unseen): (&f64, &f64)| if *unseen > UNTOLD * t { 0.0 } else { *t };
    let all = variance.iter().zip(&unseen).map(told);
    all.map(|t| (t * n / (n - 1.0)).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::Seed;

    /// Two correlated terms, one scattering by 30 % and the other not at all, and an unobservable third.
    #[test]
    fn the_scatter_comes_back_and_none_is_none() {
        let mut rng = Seed(4).stream("between");
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        let two = DMatrix::from_row_slice(2, 2, &[400.0, 150.0, 150.0, 300.0]);
        let root = two.clone().cholesky().unwrap().l();
        let mut view = |_| {
            let sizes = DVector::from_vec(vec![0.3 * draw(), 0.0]);
            let seen = &two * sizes + &root * DVector::from_vec(vec![draw(), draw()]);
            // And a third that planes absorb.
            Evidence { a: two.clone().resize(3, 3, 0.0), b: seen.resize_vertically(3, 0.0) }
        };
        let views: Vec<Evidence> = (0..400).map(&mut view).collect();
        let found = scatter(&views, 3);
        assert!((found[0] - 0.3).abs() < 0.04 && found[1] < 0.04, "{found:?}");
        assert_eq!(found[2], 0.0);
    }
}
