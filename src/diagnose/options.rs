//! Settings of a diagnosis, and the few numbers that all its parts go by.

use crate::measure::MeasureOptions;
use crate::rng::Seed;

/// Settings of a diagnosis.
#[derive(Debug, Clone, Copy)]
pub struct DiagnoseOptions {
    pub seed: Seed,
    /// Chance that a clean recording is said to have anything wrong.
    pub level: f64,
    /// The model was calibrated on this very recording, causes and all: sigma is refitted beside
    /// whatever is found, and that is no finding.
    pub calibrated_here: bool,
    /// Nothing, but in tests of what each part is for.
    pub ablation: Ablation,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        DiagnoseOptions {
            seed: Seed(1),
            level: 0.03,
            calibrated_here: false,
            ablation: Ablation::None,
        }
    }
}

/// Which part is left out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Ablation {
    #[default]
    None,
    /// Every pixel of every frame counts as a sample of its own, whatever it shares with others.
    NoCorrelation,
    /// What gains a nat on views left out is there, as Akaike has it for one parameter: no
    /// simulation of noise alone through the whole search.
    UncalibratedThresholds,
}

/// Fewest views that anything is said about.
pub const MIN_VIEWS: usize = 3;
/// Single frames kept whole: enough for correlations in time.
pub const FRAMES_KEPT: usize = 4;

/// Standard deviations that 80 % of a Gaussian lie above, below its mean.
pub const POWER_80: f64 = 0.84;

pub fn measure_options(options: &DiagnoseOptions) -> MeasureOptions {
    MeasureOptions { seed: options.seed, ..MeasureOptions::default() }
}
