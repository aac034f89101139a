//! Searches of the mean and of the size of the noise.

use nalgebra::DVector;
use rayon::prelude::*;

use super::bias;
use super::candidate::{Candidate, RECALIBRATE};
use super::evidence::{Gain, gain};
use super::outcome::{Chosen, Outcome};
use super::prepared::evidence_of_bases;
use super::rules::Rules;
use super::search;
use super::variance;
use crate::camera::Camera;
use crate::diagnose::joint::{error::clustered, refit};
use crate::diagnose::options::Ablation;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::samples::{ViewData, coarser, smooth_px};
use crate::diagnose::views::tiles::SIDE;
use crate::effects::Bounds;
use crate::model::SigmaModel;
use crate::rng::Seed;
use crate::terms::Basis;

/// Maximum number of terms in a layer.
const MAX_TERMS: usize = 10;
/// A name that explains less than this share of what a nameless curve explains is not the cause.
const NAME_ADEQUATE: f64 = 0.6;
/// The same on the name's own axis. Biases by other formulas brought 97 % and more of the best curve's
/// gain there (92 development sets of 50 to 5000 nats), a dent near the middle 86 to 87 % as a bowl.
/// Shapes of the noise's size are not as exact.
const OWN_AXIS_ADEQUATE: f64 = 0.92;
/// Prior precision of a bias coefficient: a few px at most.
pub const BIAS_PRIOR: f64 = 0.1;
/// Prior precision of a log-variance coefficient: a factor of e is already much.
pub const VARIANCE_PRIOR: f64 = 1.0;

impl Survey {
    /// Number of image pixels covered by the target of any view.
    fn covered_px(&self, camera: &Camera) -> f64 {
        let across = camera.width.div_ceil(SIDE);
        let mut seen = vec![false; across * camera.height.div_ceil(SIDE)];
        for place in self.views.iter().flat_map(|v| v.places.iter()) {
            seen[place.v as usize / SIDE * across + place.u as usize / SIDE] = true;
        }
        (seen.iter().filter(|s| **s).count() * SIDE * SIDE) as f64
    }

    /// Bounds on what these views can show of an effect.
    pub fn bounds<'a>(&'a self, camera: &'a Camera) -> Bounds<'a> {
        Bounds {
            camera,
            reach: &self.reach,
            patch_px: SIDE as f64,
            flat: self.flat,
            kind: self.kind,
        }
    }

    /// Rules of the search of the mean.
    pub fn bias_rules(&self, camera: &Camera, level: f64) -> Rules {
        Rules {
            level,
            prior: BIAS_PRIOR,
            adequacy: NAME_ADEQUATE,
            own_axis_adequacy: OWN_AXIS_ADEQUATE,
            agreed: false,
            max_terms: MAX_TERMS,
            fixed: (self.fixed_px2 > 0.0).then(|| (self.fixed_px2.sqrt(), self.covered_px(camera))),
            calibrated: self.ablation != Ablation::UncalibratedThresholds,
            learnt_from: self.learnt_from[0],
        }
    }

    /// Terms of the mean, best first, fitted together without smooth maps or priors on their usual
    /// sizes. `fine` are the views' means ([`Survey::mean_data`]).
    pub fn search_bias(
        &self,
        fine: &[ViewData],
        camera: &Camera,
        level: f64,
        seed: Seed,
    ) -> Outcome {
        let rules = self.bias_rules(camera, level);
        let candidates = bias::candidates(&self.bounds(camera));
        let side = smooth_px(camera.width);
        let coarse: Vec<ViewData> = fine.par_iter().map(|v| coarser(v, side)).collect();
        search(fine, &coarse, &candidates, None, &rules, seed)
    }

    /// Refits the terms found in these means jointly.
    pub fn refit_bias(&self, fine: &[ViewData], camera: &Camera, found: Outcome) -> Outcome {
        let inflation: Vec<f64> = self.views.iter().map(|v| v.inflation).collect();
        let second = self.second();
        refit(fine, &inflation, &second, camera, found.halved(&second, BIAS_PRIOR))
    }

    /// Rules of the search of the variance.
    pub fn variance_rules(&self, level: f64) -> Rules {
        Rules {
            level,
            prior: VARIANCE_PRIOR,
            adequacy: NAME_ADEQUATE,
            own_axis_adequacy: 0.0,
            agreed: true,
            max_terms: MAX_TERMS,
            fixed: None,
            calibrated: self.ablation != Ablation::UncalibratedThresholds,
            learnt_from: self.learnt_from[1],
        }
    }

    /// Refit of sigma, fitted together with every hypothesis of the variance; `None` unless sigma was
    /// calibrated on these views.
    pub fn refitted(&self) -> Option<Candidate> {
        self.refits_sigma.then(|| variance::refit(&self.reach))
    }

    pub fn search_variance(
        &self,
        sigma: &SigmaModel,
        camera: &Camera,
        level: f64,
        seed: Seed,
    ) -> Outcome {
        let mut candidates = variance::candidates(&self.bounds(camera), sigma);
        let refit = self.refitted();
        if refit.is_some() {
            candidates.retain(variance::beyond_sigma);
        }
        let data = self.variance_data();
        let refits = refit.is_some();
        let rules = self.variance_rules(level);
        let mut found = search(&data, &data, &candidates, refit, &rules, seed);
        if refits {
            found = with_best_surface(&data, found, variance::surfaces(&self.reach));
        }
        cluster(&mut found);
        found.halved(&self.second(), VARIANCE_PRIOR)
    }
}

/// Replaces sigma's free refit, fitted together with every hypothesis, by the surface that best
/// predicts left-out views beside the terms found, or by none.
fn with_best_surface(data: &[ViewData], found: Outcome, surfaces: Vec<Candidate>) -> Outcome {
    let (refit, others): (Vec<Chosen>, Vec<Chosen>) =
        found.chosen.into_iter().partition(|c| c.candidate.family == Some(RECALIBRATE));
    let of = |surface: Option<&Candidate>| {
        let bases: Vec<&Basis> =
            others.iter().map(|c| &c.candidate).chain(surface).map(|c| &c.basis).collect();
        let evidence = evidence_of_bases(data, &bases);
        let fit = if bases.is_empty() { None } else { gain(&evidence, VARIANCE_PRIOR) };
        (evidence, fit)
    };
    let total = |fit: &Option<Gain>| fit.as_ref().map_or(0.0, |f| f.total);
    let mut best = (None, of(None));
    let alone = total(&best.1.1);
    for surface in surfaces {
        let with = of(Some(&surface));
        if total(&with.1) > total(&best.1.1) {
            best = (Some(surface), with);
        }
    }
    let (surface, (evidence, fit)) = best;
    let gain = total(&fit) - alone;
    let mut chosen = others;
    if let (Some(candidate), Some(old)) = (surface, refit.into_iter().next()) {
        chosen.push(Chosen { candidate, gain, ..old });
    }
    Outcome { chosen, fit, evidence, ..found }
}

/// Sets the covariance of the terms, with the views as the sample.
fn cluster(found: &mut Outcome) {
    let Some(fit) = &mut found.fit else { return };
    let beyond: Vec<DVector<f64>> =
        found.evidence.iter().map(|e| &e.b - &e.a * &fit.beta).collect();
    fit.covariance = clustered(&fit.covariance, 1.0, &beyond);
    let eigen = fit.covariance.clone().symmetric_eigen();
    let factor = |k: usize| eigen.eigenvectors.column(k) * eigen.eigenvalues[k].max(0.0).sqrt();
    found.covariance.factors =
        (0..eigen.eigenvalues.len()).map(|k| factor(k).as_slice().to_vec()).collect();
}
