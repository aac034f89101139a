//! The engine with one of its parts disabled, to show what that part is for. Used by tests only.

use crate::diagnose::options::Ablation;
use crate::diagnose::search::rules::Rules;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::layers::Survey;
use crate::stats::Correlation;

impl Ablation {
    pub(in crate::diagnose) fn rules(self, rules: Rules) -> Rules {
        match self {
            Ablation::UncalibratedThresholds => Rules { calibrated: false, ..rules },
            _ => rules,
        }
    }
}

impl Survey {
    pub(in crate::diagnose) fn ablate(&mut self, ablation: Ablation, fields: &[Field]) {
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
