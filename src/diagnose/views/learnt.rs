//! The other views that a model was learnt from: what they could not settle is no finding.

use statrs::distribution::{ContinuousCDF, Normal};

use super::known::KnownTerms;
use crate::diagnose::options::DiagnoseOptions;
use crate::model::NoiseModel;

/// Views that taught a model, where they are not the ones that are looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learnt {
    pub views: f64,
    /// Everything was looked for in them, and what was found is in the model.
    pub searched: bool,
}

impl Learnt {
    /// Views that sigma was fitted to, or that a diagnosis searched; `None` where the model names
    /// none.
    pub fn of(model: &NoiseModel) -> Option<Self> {
        let (fit, searched) = (model.fit.views, model.fit.searched);
        let views = searched.map_or(fit, |s| s.views);
        (views > 0).then_some(Learnt { views: views as f64, searched: searched.is_some() })
    }

    /// The same for the distances that were measured by other means.
    pub fn references(model: &NoiseModel) -> Option<Self> {
        let references = model.fit.searched.map_or(0, |s| s.references);
        (references > 0).then_some(Learnt { views: references as f64, searched: true })
    }

    /// How much further than by their own error so many `views` may be off from the model, in
    /// variance. What the model has is off by its own error, one over its views. What it has not was
    /// looked for, and may be just too small to be seen there: in amplitudes, with the threshold of
    /// both at one, sqrt(views / its views); beyond it stands a difference of two measurements.
    pub fn excess(&self, views: f64) -> f64 {
        let share = views / self.views;
        let measured = 1.0 + share;
        if self.searched { (share.sqrt() + measured.sqrt()).powi(2) } else { measured }
    }

    /// The same once the model's own error was taken out of the views, by its covariance: a model that nobody
    /// searched leaves nothing open beside it.
    pub fn unseen_excess(&self, views: f64) -> f64 {
        if self.searched { self.excess(views) } else { 1.0 }
    }

    /// A chance of `views` that counted noise alone, as one of noise and of what a search of the
    /// others may have left; a model that nobody searched for it says nothing of it.
    pub fn p(&self, p: f64, views: f64) -> f64 {
        let normal = Normal::standard();
        let deviations = -normal.inverse_cdf(p);
        if self.searched { normal.sf(deviations / self.excess(views).sqrt()) } else { p }
    }
}

/// Views that the model's bias, and its sigma, were learnt from, where these are others.
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

    /// Against any number of views that taught the model, two measurements at most; against as many
    /// as are looked at, what was just not seen there counts too.
    #[test]
    fn few_views_leave_more_open() {
        let of = |views: f64, searched| Learnt { views, searched }.excess(20.0);
        assert!((of(1e9, true) - 1.0).abs() < 1e-3 && (of(1e9, false) - 1.0).abs() < 1e-3);
        assert_eq!(of(20.0, false), 2.0);
        approx::assert_relative_eq!(of(20.0, true), 3.0 + 8f64.sqrt(), max_relative = 1e-12);
        assert!(of(5.0, true) > of(20.0, true));
        let unseen = |searched| Learnt { views: 20.0, searched }.unseen_excess(20.0);
        assert_eq!([unseen(false), unseen(true)], [1.0, of(20.0, true)]);
        let many = Learnt { views: 1e9, searched: true };
        for p in [1e-12, 1e-3, 0.2] {
            approx::assert_relative_eq!(many.p(p, 20.0), p, max_relative = 1e-2);
        }
        let few = Learnt { views: 20.0, searched: true };
        assert!(few.p(1e-3, 20.0) > 0.05 && few.p(0.0, 20.0) == 0.0);
        assert_eq!(Learnt { searched: false, ..few }.p(1e-3, 20.0), 1e-3);
    }
}
