//! Removes a model's biases from depth images by inverting the effects of the light's path.
//!
//! ```text
//! raw -> z -driver-> disparity -still, locking, terms-> disparity -> z -> raw
//! ```
//! A [`Correction`] corrects one depth image. If the model holds the covariance of its biases, it also gives
//! the uncertainty of each corrected depth. [`correct_recording`] corrects all images of a folder.

mod correction;
mod describe;
mod files;
mod invert;
mod raw;
mod recording;
mod rewrite;
mod sigma_images;
mod slopes;
mod uncertainty;

pub(crate) use correction::Drift;
pub use correction::{Conditions, Correction};
pub use recording::{
    CorrectOptions, Corrected, SIGMA_UNITS_PER_METRE, correct_recording, is_uncertainty,
};
pub use sigma_images::{SigmaImages, sigma_images};
