//! The noise model: sigma(z, theta) with its domain and certainty, and the file it lives in.

mod effect;
mod fault;
mod file;
mod fit;
mod forms;
mod heldout;
mod local;
mod outliers;
mod paule_mandel;
mod quality;
mod robust;
mod rows;
mod sigma_lookup;
mod statistics;
mod surface;

pub use effect::{Effect, UNEXPLAINED};
pub use file::{FitSummary, MODEL_FORMAT, NoiseModel, Provenance};
pub use fit::DISTANCE_RATIO;
pub use forms::{Form, PAPER_EQ1, SigmaForm};
pub use heldout::{HeldOut, compare_forms, held_out};
pub use outliers::{Sorted, fit, sort_out};
pub use sigma_lookup::SigmaLookup;
pub use statistics::{Parameter, SigmaFit};
pub use surface::{Direction, Domain, SigmaModel};
