//! The noise model: sigma(z, theta) with its domain and uncertainty, and its file.

mod covariance;
mod effect;
mod fault;
mod file;
mod fit;
mod forms;
mod heldout;
mod other_sensor;
mod outliers;
mod provenance;
mod robust;
mod rows;
mod statistics;
mod surface;
mod uncertainty;

pub use covariance::Covariance;
pub use effect::{Effect, UNEXPLAINED};
pub(crate) use file::model_schema;
pub use file::{MODEL_FORMAT, NoiseModel};
pub use fit::DISTANCE_RATIO;
pub use forms::{Form, PAPER_EQ1, SigmaForm};
pub use heldout::{HeldOut, compare_forms};
pub use outliers::{Sorted, sort_out};
pub use provenance::{FitSummary, Provenance, Searched};
pub use statistics::{Parameter, Quality, SigmaFit};
pub use surface::{Direction, Domain, SigmaLookup, SigmaModel};
pub use uncertainty::{Conditions, NO_ACCEPTANCE_TEST, Uncertainty, ViewUncertainty};
