//! When simulation and recording differ: where, why, and what is gained by knowing.
//!
//! `engine` starts, `case` holds the views, `battery` runs the tests and `conclude` says what they come to.
//! `views` makes residuals of recordings; `search` and `joint` find what the mean and the size of the
//! noise have too much; `noise`, `steps`, `edges`, `missing` and `distance` look at the rest; `against` holds a
//! simulated recording beside them; `finding` puts results into names, numbers and words; `checks` are what a
//! finding must stand. How it all works: [`crate::docs::engine`].

mod against;
mod battery;
mod case;
mod checks;
mod conclude;
mod diagnosis;
mod distance;
mod echoes;
mod edges;
mod engine;
mod finding;
mod joint;
mod missing;
mod noise;
mod options;
mod pictures;
mod search;
mod steps;
mod verdict;
mod views;

pub use diagnosis::*;
pub use engine::{Diagnosed, diagnose, diagnose_against};
pub use options::{Ablation, DiagnoseOptions};
pub use pictures::{ViewPictures, pictures};
pub use views::field::Field;
pub use views::known::KnownTerms;
