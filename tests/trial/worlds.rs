//! Where the sets come from.

use std::path::Path;

use super::{Asked, Sealed, World, light, rays, real};
use kinoise::error::{Error, Result};

/// The set that is `asked`; `data` is the folder of the real recordings.
///
/// # Errors
/// When its world has no such cell or effect.
pub fn seal(asked: &Asked, data: Option<&Path>) -> Result<Box<dyn Sealed>> {
    match asked.world {
        World::Rays => rays::seal(asked),
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

#[cfg(test)]
mod tests {
    use crate::raytraced::tests_sealed::walkdir;

    /// The makers of sets share nothing with the catalogue, the diagnosis or the formulas' simulator.
    #[test]
    fn the_makers_stand_apart() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/prove/rays");
        let barred = ["effects", "diagnose", "simulate", "terms"].map(|m| format!("crate::{m}"));
        let mut files = 0;
        for path in walkdir(&root) {
            let text = std::fs::read_to_string(&path).unwrap();
            let code: String = text.chars().filter(|c| !c.is_whitespace()).collect();
            for module in &barred {
                assert!(!code.contains(module), "{} uses {module}", path.display());
            }
            assert!(!code.contains("usecrate::{"), "{}: name what is used", path.display());
            files += 1;
        }
        assert!(files > 15);
    }
}
