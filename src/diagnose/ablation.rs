//! The engine with one of its parts taken out, to show what that part is for. Only tests ask for it.

use super::candidate::Candidate;
use super::field::Field;
use super::layers::Survey;
use super::search::Rules;
use crate::stats::Correlation;
use crate::terms::Basis;

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
        for Candidate { family, basis } in all {
            let basis = if family.is_some() { card(basis) } else { basis };
            if fixed.iter().all(|c| (c.family, &c.basis) != (family, &basis)) {
                fixed.push(Candidate { family, basis });
            }
        }
        fixed
    }

    /// A size below this, in sigmas, is nobody's concern.
    pub(super) fn min_size(self, least: f64) -> f64 {
        if self == Ablation::UncalibratedThresholds { 0.0 } else { least }
    }
}

/// The shape of the catalogue's own formula.
fn card(basis: Basis) -> Basis {
    match basis {
        Basis::Bowl { .. } => Basis::Bowl { disparity_power: 0.0, orders: 1 },
        Basis::Lens { fx, fy, .. } => Basis::Lens { fx, fy, orders: 1 },
        Basis::Bow { .. } => Basis::Bow { degree: 2 },
        Basis::Locking { .. } => Basis::Locking { period_px: 1.0, harmonics: 1 },
        Basis::Banding { period_px, .. } => Basis::Banding { period_px, harmonics: 1 },
        Basis::RangeExponent { pivot_m, .. } => Basis::RangeExponent { pivot_m, orders: 1 },
        Basis::Vignetting { .. } => Basis::Vignetting { orders: 1 },
        Basis::Intensity { .. } => Basis::Intensity { orders: 1 },
        Basis::TiltAxis { .. } => Basis::TiltAxis { tilt_power: 1 },
        other => other,
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
