//! Settings of a diagnosis, and the constants shared by its parts.

use crate::measure::MeasureOptions;
use crate::rng::Seed;

/// Settings of a diagnosis.
#[derive(Debug, Clone, Copy)]
pub struct DiagnoseOptions {
    pub seed: Seed,
    /// Nominal false-alarm rate, divided among the tests. The shares add up to 1.25: 3 % of clean
    /// recordings if all tests were independent.
    pub level: f64,
    /// Whether the model was calibrated on this very recording, with all causes present: sigma is then
    /// refitted with everything found, and the refit is no finding.
    pub calibrated_here: bool,
    /// Part left out, for ablation tests only.
    pub ablation: Ablation,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        DiagnoseOptions {
            seed: Seed(1),
            level: 0.024,
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
    /// Every pixel of every frame counts as an independent sample.
    NoCorrelation,
    /// A gain of one nat on held-out views is significant, as by Akaike for one parameter; noise alone is
    /// not simulated through the whole search.
    UncalibratedThresholds,
}

/// Least number of views for a diagnosis.
pub const MIN_VIEWS: usize = 3;
/// Number of single frames kept: enough for correlations in time.
pub const FRAMES_KEPT: usize = 4;

/// Share of the nominal false-alarm rate for each of some 20 tests beside the searches.
pub const EACH_LEVEL: f64 = 0.025;
/// The 80 % quantile of a standard normal distribution.
pub const POWER_80: f64 = 0.84;

pub fn measure_options(options: &DiagnoseOptions) -> MeasureOptions {
    MeasureOptions { seed: options.seed, ..MeasureOptions::default() }
}
