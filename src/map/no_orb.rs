//! What stands in for OpenCV's features in a build without them.

use nalgebra::Isometry3;

use crate::camera::Rays;
use crate::error::{Error, Result};
use crate::io::ColourImage;
use crate::rng::Stream;

/// There are none.
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
