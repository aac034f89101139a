//! The engine with one of its parts taken out, to show what that part is for. Only tests ask for it.

use super::candidate::Candidate;
use super::field::Field;
use super::layers::Survey;
use super::outcome::Rules;
use crate::stats::Correlation;

/// Which part is left out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Ablation {
    #[default]
    None,
    /// Every pixel of every frame counts as a sample of its own, whatever it shares with others.
    NoCorrelation,
    /// What gains a nat on views left out is there, as Akaike has it for one parameter: no
    /// simulation of noise alone through the whole search, and no least size.
    UncalibratedThresholds,
    /// Every name has the one formula of its catalogue card; what only scales it stays free.
    FixedFormulas,
}

impl Ablation {
    pub(super) fn rules(self, rules: Rules) -> Rules {
        match self {
            Ablation::UncalibratedThresholds => Rules { calibrated: false, least: 0.0, ..rules },
            _ => rules,
        }
    }

    pub(super) fn candidates(self, all: Vec<Candidate>) -> Vec<Candidate> {
        if self != Ablation::FixedFormulas {
            return all;
        }
        let mut fixed: Vec<Candidate> = Vec::new();
        for mut candidate in all {
            if let Some(effect) = candidate.effect() {
                candidate.basis = effect.plain(candidate.basis);
            }
            let same = |c: &Candidate| (c.family, &c.basis) == (candidate.family, &candidate.basis);
            if !fixed.iter().any(same) {
                fixed.push(candidate);
            }
        }
        fixed
    }

    /// Smaller terms, in sigmas, are not reported.
    pub(super) fn min_size(self, least: f64) -> f64 {
        if self == Ablation::UncalibratedThresholds { 0.0 } else { least }
    }
}

impl Survey {
    pub(super) fn ablate(&mut self, ablation: Ablation, fields: &[Field]) {
        self.ablation = ablation;
        if ablation != Ablation::NoCorrelation {
            return;
        }
        for (view, field) in self.views.iter_mut().zip(fields) {
            view.inflation /= view.correlation.sum;
            view.correlation =
                Correlation { sum: 1.0, sum_of_squares: 1.0, ..view.correlation.clone() };
            view.frames = field.frames.len() as f64;
        }
    }
}
