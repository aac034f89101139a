//! When simulation and recording differ: where, why, and what is gained by knowing.

mod against;
mod bias;
mod candidate;
mod detectable;
mod diagnosis;
mod engine;
mod evidence;
mod field;
mod findings;
mod heldout;
mod known;
mod lattice;
mod next_view;
mod noise;
mod parameters;
mod partners;
mod pictures;
mod layers;
mod missing;
mod missing_cells;
mod missing_fit;
mod missing_report;
mod missing_search;
mod missing_shapes;
mod reach;
mod reference;
mod rim;
mod search;
mod shape;
mod shadow;
mod shadow_test;
mod smooth;
mod structure;
mod tiles;
mod variance;

pub use diagnosis::*;
pub use engine::{DiagnoseOptions, Diagnosed, diagnose, diagnose_against};
pub use field::Field;
pub use known::Known;
pub use lattice::{Lattice, Words};
pub use layers::Survey;
pub use missing::{MissingFinding, MissingOutcome, missing};
pub use pictures::{ViewPictures, pictures};
pub use search::Outcome;

