//! Diagnoses differences between simulation and recording: where, why, and what is gained by knowing.
//!
//! `engine` is the entry point, `case` holds the views, `battery` runs the tests and `conclude` assembles the
//! results. `views` turns recordings into residuals; `search` and `joint` search the mean and the size of the
//! noise for missing effects; `noise`, `steps`, `edges`, `missing` and `distance` cover the rest; `against`
//! compares with a simulated recording; `finding` turns results into names, numbers and text; `checks` test
//! findings. How it all works: [`crate::docs::engine`].

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
mod reproduced;
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
