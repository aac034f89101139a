//! Stub for the ORB features in a build without OpenCV.

use nalgebra::Isometry3;

use crate::camera::Rays;
use crate::error::{Error, Result};
use crate::io::ColourImage;
use crate::rng::Stream;

/// Never constructed.
pub struct Features;

impl Features {
    /// Always an error: this build has no OpenCV.
    pub fn of(_: &ColourImage, _: &[f32], _: &Rays) -> Result<Self> {
        Err(Error::Argument {
            what: "this kinoise was built without OpenCV".into(),
            remedy: "use --init none or motion, or build with the feature \"opencv\"",
        })
    }

    pub fn motion_to(&self, _: &Features, _: &mut Stream) -> Result<Option<Isometry3<f64>>> {
        Ok(None)
    }
}
