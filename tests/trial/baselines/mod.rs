//! What others would do with the same recording: all get the same tiles of the residuals, and fit
//! the bias, then the noise where they have a way to.
//!
//! None of them asks whether there is anything to find; some give names, by a mapping from formula
//! to cause that stands in this folder.

mod clams;
mod formula;
mod gaussian;
mod learnt;
mod linear;
mod polynomial;
mod sparse;
mod symbolic;
#[cfg(test)]
mod tests;
mod tiles;

pub use clams::Clams;
pub use gaussian::GaussianProcess;
pub use learnt::Learnt;
pub use polynomial::Polynomial;
pub use sparse::Sparse;
pub use symbolic::Symbolic;
pub use tiles::{Tile, Tiles};

use crate::raytraced::question::Predictor;
use kinoise::error::Result;

/// A way of learning from tiles.
pub trait Baseline: Send + Sync {
    fn name(&self) -> &'static str;

    /// # Errors
    /// When the tiles are too few to fit anything.
    fn fit(&self, tiles: &Tiles) -> Result<Fitted>;
}

/// What was learnt.
pub struct Fitted {
    pub predictor: Box<dyn Predictor>,
    /// Numbers that were fitted.
    pub parameters: usize,
    /// Ids of the catalogue that it says are missing; `None` from those that know no names.
    pub names: Option<Vec<String>>,
}

/// All that learn.
pub fn all() -> Vec<Box<dyn Baseline>> {
    vec![
        Box::new(Polynomial),
        Box::new(Clams),
        Box::new(Sparse),
        Box::new(GaussianProcess),
        Box::new(Symbolic::default()),
    ]
}
