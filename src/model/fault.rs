//! Checks that the numbers of a model are valid.

use nalgebra::{DMatrix, SymmetricEigen};

use super::surface::{Domain, SigmaModel};
use crate::frame::FARTHEST_M;
use crate::read::MAX_NUMBER;
use crate::stats::even;

/// Points per side at which sigma is checked over the domain. The forms are smooth on this scale, except
/// for a parabola's vertex, which is checked by itself.
const GRID: usize = 33;

/// Tolerance for rounding of a correlation matrix: its entries are good to about 1e-16 times the condition
/// number of the fit, which `statistics::UNSEEN` bounds well below what this allows.
const ROUNDING: f64 = 1e-8;

impl SigmaModel {
    /// What is wrong with these numbers as a model, if anything: shape, domain, uncertainty, and
    /// sigma itself, which must be finite and positive on the whole domain.
    pub fn fault(&self) -> Option<String> {
        self.wrong_shape()
            .or_else(|| self.wrong_domain())
            .or_else(|| self.wrong_certainty())
            .or_else(|| self.wrong_sigma())
    }

    fn wrong_shape(&self) -> Option<String> {
        let p = self.form.card().parameters.len();
        let fits = self.parameters.len() == p
            && self.covariance.shape() == (p, p)
            && self.std_errors.len() == p;
        if !fits {
            return Some(format!(
                "the form \"{}\" has {p} parameters and a {p} x {p} covariance",
                self.form
            ));
        }
        // What is written must be readable again.
        let mut numbers = self.parameters.iter().chain(self.covariance.iter());
        let measured = numbers.all(|v| v.abs() <= MAX_NUMBER);
        (!measured).then(|| {
            "a parameter or covariance is not finite, or beyond any number that is measured".into()
        })
    }

    fn wrong_domain(&self) -> Option<String> {
        let Domain { z_m, theta_rad } = self.domain;
        let range = |[low, high]: [f64; 2]| {
            low.is_finite() && high.is_finite() && low >= 0.0 && low <= high
        };
        if !range(z_m) || !range(theta_rad) || z_m[0] <= 0.0 {
            return Some("the valid range is empty or not positive".into());
        }
        if theta_rad[1] >= std::f64::consts::FRAC_PI_2 {
            return Some(format!(
                "the valid range of theta ends at {} rad; a plane is seen below pi/2 only",
                theta_rad[1]
            ));
        }
        if z_m[1] > FARTHEST_M {
            return Some(format!(
                "the valid range of z ends at {:e} m; no such sensor sees beyond {FARTHEST_M} m",
                z_m[1]
            ));
        }
        let pole = self.form.spec().pole(&self.parameters);
        pole.is_some_and(|pole| pole <= theta_rad[1])
            .then(|| "the valid range of theta reaches the pole of the form".into())
    }

    fn wrong_certainty(&self) -> Option<String> {
        if !(self.degrees_of_freedom >= 1.0 && self.degrees_of_freedom.is_finite()) {
            return Some(format!("degrees_of_freedom = {}, below 1", self.degrees_of_freedom));
        }
        if self.std_errors.iter().flatten().any(|e| !(e.is_finite() && *e >= 0.0)) {
            return Some("a std_error is negative or not finite".into());
        }
        (!is_covariance(&self.covariance))
            .then(|| "the covariance is not symmetric and positive semi-definite".into())
    }

    fn wrong_sigma(&self) -> Option<String> {
        let spec = self.form.spec();
        let Domain { z_m, theta_rad } = self.domain;
        let along = |ends: [f64; 2]| even(ends, GRID);
        let vertex = spec.vertex(&self.parameters).map(|c| c.clamp(z_m[0], z_m[1]));
        vertex
            .into_iter()
            .chain(along(z_m))
            .flat_map(|z| along(theta_rad).map(move |t| (z, t)))
            .find_map(|(z, theta)| {
                let sigma = self.sigma(z, theta);
                let at = || format!("sigma at z = {z:.3} m, theta = {theta:.3} rad is {sigma:e} m");
                if !(sigma.is_finite() && sigma > 0.0) {
                    return Some(format!("{}, inside the valid range but not positive", at()));
                }
                (sigma > FARTHEST_M).then(|| format!("{}, more than any depth", at()))
            })
    }
}

/// Whether the matrix is symmetric and positive semi-definite, within rounding. Judged on the correlations,
/// because the scales of the parameters differ by many orders of magnitude.
fn is_covariance(covariance: &DMatrix<f64>) -> bool {
    let p = covariance.nrows();
    let root: Vec<f64> = covariance.diagonal().iter().map(|v| v.sqrt()).collect();
    if root.iter().any(|r| r.is_nan()) {
        return false;
    }
    let correlation = DMatrix::from_fn(p, p, |i, j| match covariance[(i, j)] {
        // A held parameter has neither variance nor covariance.
        0.0 => 0.0,
        c => c / root[i] / root[j],
    });
    let symmetric = (&correlation - correlation.transpose()).amax() <= ROUNDING;
    let finite = correlation.iter().all(|v| v.is_finite());
    finite && symmetric && SymmetricEigen::new(correlation).eigenvalues.min() >= -ROUNDING
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Form, PAPER_EQ1};

    fn says(change: impl Fn(&mut SigmaModel)) -> String {
        let mut model = SigmaModel::paper();
        change(&mut model);
        model.fault().unwrap_or_default()
    }

    #[test]
    fn published_surfaces_have_no_fault() {
        for model in [SigmaModel::paper(), SigmaModel::nguyen(), SigmaModel::khoshelham()] {
            assert_eq!(model.fault(), None);
        }
    }

    /// Positive at all four corners, negative at the vertex in between.
    #[test]
    fn a_dip_below_zero_between_the_corners_is_found() {
        for (a, c) in [(-1e-4, 2.5), (0.0, 2.5), (-1e-9, 1.0371)] {
            let text = says(|m| (m.parameters[0], m.parameters[2]) = (a, c));
            assert!(text.contains(&format!("z = {c:.3}")), "a {a}: {text}");
        }
        let corner = says(|m| m.parameters[3] = -1e-4);
        assert!(corner.contains("theta"), "{corner}");
    }

    #[test]
    fn a_vertex_outside_the_range_may_be_below_zero() {
        let mut parameters = PAPER_EQ1;
        (parameters[0], parameters[2]) = (-1e-4, -1.0);
        let model = SigmaModel::published(Form::Paper, &parameters, SigmaModel::paper().domain);
        assert_eq!(model.fault(), None);
    }

    #[test]
    fn a_covariance_that_is_none_is_found() {
        let set = |entries: &[(usize, usize, f64)]| {
            says(|m| entries.iter().for_each(|&(i, j, v)| m.covariance[(i, j)] = v))
        };
        let wrong = "positive semi-definite";
        assert!(set(&[(0, 0, -1e-12)]).contains(wrong));
        assert!(set(&[(0, 0, 1e-12), (1, 1, 1e-12), (0, 1, 5e-13)]).contains(wrong), "lopsided");
        let pair = |c: f64| set(&[(0, 0, 1e-12), (2, 2, 1e-6), (0, 2, c), (2, 0, c)]);
        assert!(pair(1.001e-9).contains(wrong), "correlation above one");
        assert_eq!(pair(-1e-9), "", "a correlation of one is none of its business");
        assert!(
            set(&[(0, 1, 1e-12), (1, 0, 1e-12)]).contains(wrong),
            "shared, but none of its own"
        );
        assert!(set(&[(0, 0, f64::NAN)]).contains("not finite"));
    }

    #[test]
    fn certainty_and_domain_are_checked() {
        for dof in [0.0, 0.999, -3.0, f64::NAN, f64::INFINITY] {
            assert!(says(|m| m.degrees_of_freedom = dof).contains("degrees_of_freedom"), "{dof}");
        }
        assert!(says(|m| m.domain.z_m = [0.0, 1.0]).contains("valid range"));
    }
}
