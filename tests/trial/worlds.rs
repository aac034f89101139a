//! Where the sets come from.

use std::path::Path;

use crate::raytraced::question::{Asked, Sealed, World};
use crate::{light, raytraced, real};
use kinoise::error::{Error, Result};

/// The set that is `asked`; `data` is the folder of the real recordings.
///
/// # Errors
/// When its world has no such cell or effect.
pub fn seal(asked: &Asked, data: Option<&Path>) -> Result<Box<dyn Sealed>> {
    match asked.world {
        World::Rays => raytraced::seal(asked),
        World::Light => light::seal(asked),
        World::Real => {
            let data = data.ok_or_else(|| Error::Argument {
                what: "a set of a real recording was asked for, and no folder of such".into(),
                remedy: "give --data",
            })?;
            real::seal(asked, data)
        }
    }
}
