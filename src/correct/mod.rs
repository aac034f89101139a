//! Taking a model's biases out of depth again: the effects of the light's path, backwards.
//!
//! ```text
//! raw -> z -driver-> disparity -still, locking, terms-> disparity -> z -> raw
//! ```
//! A [`Correction`] does one depth image, and says how sure each corrected depth is where the model
//! holds the covariance of its biases; [`correct_recording`] does all that lie in a folder.

mod correction;
mod describe;
mod files;
mod invert;
mod locking;
mod raw;
mod recording;
mod rewrite;
mod sigma_images;
mod slopes;
mod uncertainty;

pub use correction::{Conditions, Correction};
pub(crate) use correction::{Drift, LearntTerm};
pub use recording::{CorrectOptions, Corrected, SIGMA_UNITS_PER_METRE, correct_recording};
pub use sigma_images::{SigmaImages, sigma_images};
