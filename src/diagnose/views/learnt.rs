//! The other views a model was learnt from: what they left uncertain is no finding.

use statrs::distribution::{ContinuousCDF, Normal};

use super::known::KnownTerms;
use crate::diagnose::options::DiagnoseOptions;
use crate::model::NoiseModel;

/// Views a model was learnt from, where they are not the ones under diagnosis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learnt {
    pub views: f64,
    /// Whether a full search was run on them, with all findings in the model.
    pub searched: bool,
}

impl Learnt {
    /// Views that sigma was fitted to, or that a diagnosis searched; `None` where the model states none.
    pub fn of(model: &NoiseModel) -> Option<Self> {
        let (fit, searched) = (model.fit.views, model.fit.searched);
        let views = searched.map_or(fit, |s| s.views);
        (views > 0).then_some(Learnt { views: views as f64, searched: searched.is_some() })
    }

    /// Same for reference distances measured by other means.
    pub fn references(model: &NoiseModel) -> Option<Self> {
        let references = model.fit.searched.map_or(0, |s| s.references);
        (references > 0).then_some(Learnt { views: references as f64, searched: true })
    }

    /// Ratio of the variance of the difference between `views` and the model to the variance of the views
    /// alone; the model's own variance is one over its views.
    pub fn of_difference(&self, views: f64) -> f64 {
        1.0 + views / self.views
    }

    /// Variance inflation of so many `views` about the model, once the model's stated error has been
    /// absorbed by its covariance. An effect that is not in the model may be just below the threshold of
    /// its search: in units of the threshold here, an amplitude of sqrt(views / its views). The standard
    /// deviation of the difference of two measurements adds to it. 1 for a model that was never searched.
    pub fn excess(&self, views: f64) -> f64 {
        if !self.searched {
            return 1.0;
        }
        ((views / self.views).sqrt() + self.of_difference(views).sqrt()).powi(2)
    }

    /// Converts a p-value of `views` under noise alone into one that allows for effects the model's search
    /// may have missed. Unchanged for a model that was never searched.
    pub fn p(&self, p: f64, views: f64) -> f64 {
        let normal = Normal::standard();
        let deviations = -normal.inverse_cdf(p);
        if self.searched { normal.sf(deviations / self.excess(views).sqrt()) } else { p }
    }
}

/// Views that the model's bias and its sigma were learnt from, where they differ from these.
pub fn learnt_from(
    model: &NoiseModel,
    known: &KnownTerms,
    options: &DiagnoseOptions,
    against: bool,
) -> [Option<Learnt>; 2] {
    let others = !against && !options.calibrated_here;
    let learnt = Learnt::of(model).filter(|_| others);
    [learnt.filter(|l| l.searched || known.bias_is_learnt()), learnt]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With as many model views as new ones, the difference has twice the variance, and effects just below
    /// the model's threshold add to that.
    #[test]
    fn few_views_leave_more_open() {
        let learnt = |views: f64, searched| Learnt { views, searched };
        let of = |views: f64| learnt(views, true).excess(20.0);
        let difference = |views: f64| learnt(views, false).of_difference(20.0);
        assert!((of(1e9) - 1.0).abs() < 1e-3 && (difference(1e9) - 1.0).abs() < 1e-3);
        assert_eq!(difference(20.0), 2.0);
        approx::assert_relative_eq!(of(20.0), 3.0 + 8f64.sqrt(), max_relative = 1e-12);
        assert!(of(5.0) > of(20.0));
        assert_eq!(learnt(20.0, false).excess(20.0), 1.0);
        let many = Learnt { views: 1e9, searched: true };
        for p in [1e-12, 1e-3, 0.2] {
            approx::assert_relative_eq!(many.p(p, 20.0), p, max_relative = 1e-2);
        }
        let few = Learnt { views: 20.0, searched: true };
        assert!(few.p(1e-3, 20.0) > 0.05 && few.p(0.0, 20.0) == 0.0);
        assert_eq!(Learnt { searched: false, ..few }.p(1e-3, 20.0), 1e-3);
    }
}
