//! Estimates, from reference distances, the constant of a bias that planes absorb whole.
//!
//! An image-fixed bias may hold any constant: every plane absorbs it, and the joint fit makes it zero
//! on average over the image. Correcting by it would shift all distances by an unmeasured amount.
//! Reference distances measure it.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::camera::Camera;
use crate::diagnose::distance::referenced_view::ReferencedView;
use crate::diagnose::views::samples::ViewData;
use crate::model::Effect;
use crate::solve::Cholesky;
use crate::terms::{
    Basis, Coordinate, DISPARITY_UNIT_PX, Modulation, PixelContext, Pixels, Term, affine_parts,
};

/// Biases of one power of the disparity, whose constant planes do not determine.
pub struct Family {
    power: f64,
    /// Root mean square over the image, px: the constant is taken to be of the size of the shapes.
    usual: f64,
}

impl Family {
    /// Usual size of a constant that is the same disparity at all distances, px; 0 for other powers.
    pub fn still_px(&self) -> f64 {
        if self.power == 0.0 { self.usual } else { 0.0 }
    }

    /// Change of a distance, m, when a constant of the usual size is subtracted.
    pub fn moves_m(&self, c: &ReferencedView) -> f64 {
        let disparity = c.px_m / c.z;
        -c.moved_by_a_px() * self.usual * (disparity / DISPARITY_UNIT_PX).powf(self.power)
    }
}

/// Adds constants to the learnt biases of `added` so that corrected distances agree with the
/// references. `checked` are the references with these biases, and all laws, subtracted, and
/// `variances` their variances, m^2.
pub fn anchor(
    added: &mut [Effect],
    checked: &[ReferencedView],
    variances: &[f64],
    camera: &Camera,
) {
    let families = families(added.iter().flat_map(|e| &e.shape), camera);
    for (Family { power, usual }, [shift, error]) in
        families.iter().zip(constants(&families, checked, variances))
    {
        let times = Modulation::still(*power);
        let of_power = |t: &Term| t.is_correctable() && t.basis.still_power() == Some(*power);
        if let Some(effect) = added.iter_mut().find(|e| e.shape.iter().any(of_power)) {
            lift(effect, times, shift * usual, (error * usual).powi(2));
        }
    }
}

pub fn families<'a>(terms: impl Iterator<Item = &'a Term>, camera: &Camera) -> Vec<Family> {
    let rays = camera.rays();
    let pixels = Pixels::new(camera, &rays, 1.0);
    let mut families: Vec<Family> = Vec::new();
    for term in terms.filter(|t| t.is_correctable() && !matches!(t.basis, Basis::Affine { .. })) {
        let Some(power) = term.basis.still_power() else { continue };
        let square = mean_square(term, &pixels);
        match families.iter_mut().find(|f| f.power == power) {
            Some(family) => family.usual = family.usual.hypot(square.sqrt()),
            None => families.push(Family { power, usual: square.sqrt() }),
        }
    }
    families
}

fn mean_square(term: &Term, pixels: &Pixels<'_>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for place in pixels.sampled() {
        sum += term.value(&place).powi(2);
        count += 1.0;
    }
    sum / f64::max(count, 1.0)
}

/// Constant of each family in units of its usual size, with its standard error.
fn constants(families: &[Family], checked: &[ReferencedView], variances: &[f64]) -> Vec<[f64; 2]> {
    let n = families.len();
    let mut information = DMatrix::zeros(n + 2, n + 2);
    let mut score = DVector::zeros(n + 2);
    for (c, variance) in checked.iter().zip(variances) {
        // On a tilted target two small angles shift the point where the axis meets it.
        let angles = c.slope.map(|slope| c.z * slope);
        let row =
            DVector::from_iterator(n + 2, families.iter().map(|f| f.moves_m(c)).chain(angles));
        score.axpy(-c.off / variance, &row, 1.0);
        information.ger(1.0 / variance, &row, &row, 1.0);
    }
    information += DMatrix::identity(n + 2, n + 2);
    let Some(factor) = Cholesky::of(information) else { return vec![[0.0; 2]; n] };
    let (constants, covariance) = (factor.solve(&score), factor.inverse());
    (0..n).map(|k| [constants[k], covariance[(k, k)].sqrt()]).collect()
}

/// Subtracts from the lenses of `added` what every plane absorbs: where no distance was measured none
/// may move. On a plane across the optical axis a lens is its stretch times the disparity beyond the
/// reference's; the stretch's mean over the image is subtracted. Its slope bends tilted planes, and
/// stays.
pub fn let_planes_be(added: &mut [Effect], camera: &Camera) {
    let rays = camera.rays();
    let pixels = Pixels::new(camera, &rays, 1.0);
    subtract(added, |lens| {
        let Basis::Lens { reference_px, .. } = lens.basis else { return None };
        let mean = mean_stretch(&lens.basis, reference_px, &pixels)?;
        Some(mean.into_iter().map(|m| Vector2::new(-reference_px * m, m)).collect())
    });
}

/// Whether it is a bias that `correct` subtracts along a curve over the distance alone, not a ripple, which has
/// next to no linear part.
pub fn is_over_distance(term: &Term) -> bool {
    let Term { basis, .. } = term;
    let is_curve = basis.alone() == Some(Coordinate::Disparity) && basis.period().is_none();
    is_curve && term.is_correctable()
}

/// Subtracts from the curves over the distance of `added` what planes absorb: the disparity of a plane is
/// linear in the picture, so that no view shows a constant or a multiple of it, and a fit leaves them to
/// chance. What is left moves the samples of the `views` that they were learnt on the least (least squares).
pub fn let_distances_be(added: &mut [Effect], views: &[ViewData]) {
    subtract(added, |curve| {
        if !is_over_distance(curve) {
            return None;
        }
        let mut products = vec![Vector2::zeros(); curve.coefficients.len()];
        let mut square = Matrix2::zeros();
        for view in views {
            for (place, &w) in view.places.iter().zip(&view.weight) {
                let line = Vector2::new(1.0, place.disparity);
                square += w * line * line.transpose();
                curve.basis.visit(place, |k, g| products[k] += w * g * line);
            }
        }
        let inverse = square.try_inverse()?;
        Some(products.into_iter().map(|p| inverse * p).collect())
    });
}

/// Subtracts from the shapes of `added` a constant of the disparity, px, and a share of it, for each of their
/// coefficients: `parts` of a term, `None` where it has none.
fn subtract(added: &mut [Effect], parts: impl Fn(&Term) -> Option<Vec<Vector2<f64>>>) {
    for effect in added {
        let mut first = 0;
        for k in 0..effect.shape.len() {
            let term = &effect.shape[k];
            let span = first..first + term.coefficients.len();
            first = span.end;
            let Some(parts) = parts(term) else { continue };
            let sum =
                |of: &[f64]| -> Vector2<f64> { of.iter().zip(&parts).map(|(c, p)| *c * p).sum() };
            let whole = sum(&term.coefficients);
            for (j, times) in [(1, Modulation::Disparity), (0, Modulation::One)] {
                let constant = lift(effect, times, -whole[j], 0.0);
                // It has the same error as the shape.
                for factor in effect.covariance.iter_mut().flat_map(|c| &mut c.factors) {
                    factor[constant] -= sum(&factor[span.clone()])[j];
                }
            }
        }
    }
}

/// Mean of each lens column over the image, one pixel of disparity beyond the reference's.
fn mean_stretch(lens: &Basis, reference_px: f64, pixels: &Pixels<'_>) -> Option<Vec<f64>> {
    let beyond = |place| PixelContext { disparity: reference_px + 1.0, slope: [0.0; 2], ..place };
    let parts = affine_parts(lens, pixels, beyond)?;
    Some(parts.iter().map(|part| part[0]).collect())
}

/// Adds a constant of the disparity, px, to an effect's shape; returns its index among all
/// coefficients.
fn lift(effect: &mut Effect, times: Modulation, shift: f64, variance: f64) -> usize {
    let of_times = |t: &Term| matches!(&t.basis, Basis::Affine { times: own } if *own == times);
    let at = effect.shape.iter().position(of_times).unwrap_or_else(|| {
        effect.shape.push(Term::bias(Basis::Affine { times }, vec![0.0; 3]));
        if let Some(covariance) = &mut effect.covariance {
            covariance.factors.iter_mut().for_each(|f| f.extend([0.0; 3]));
            if !covariance.variances.is_empty() {
                covariance.variances.extend([0.0; 3]);
            }
        }
        effect.shape.len() - 1
    });
    effect.shape[at].coefficients[0] += shift;
    let first: usize = effect.shape[..at].iter().map(|t| t.coefficients.len()).sum();
    if let Some(own) = effect.covariance.as_mut().and_then(|c| c.variances.get_mut(first)) {
        *own += variance;
    }
    first
}

#[cfg(test)]
#[path = "anchor_tests.rs"]
mod tests;
