//! The blind trial: sets whose left-out physics is sealed away, a solver that sees nothing else,
//! and a judge who opens the seals afterwards.
//!
//! The makers of sets share no formula with the catalogue and no code with the diagnosis; only the
//! recording and the model file are common ground.

#[path = "../common/raytraced/mod.rs"]
pub mod raytraced;

mod advice;
pub mod baselines;
mod check;
mod command;
mod confine;
mod examine;
pub mod gain;
mod gains;
mod judge;
mod kept;
pub mod light;
mod make;
mod page;
mod plan;
mod proof;
pub mod real;
mod rite;
mod seal;
mod solve;
mod solver_command;
mod summary_text;
mod verdict;
mod workers;
pub mod worlds;

pub use advice::{ADVICE_FORMAT, Advice, AdvisedSet, Rediagnosed, SecondRound};
pub use check::{CheckOptions, Checked, check};
pub use confine::confine;
pub use examine::{Examination, Examine, OUR_METHOD, examine_all};
pub use gains::{Gain, Gains, Method};
pub use judge::*;
pub use kept::{KeptCurve, kept_curve};
pub use plan::{Planned, plan};
pub use proof::{Ordered, PROOF_FORMAT, Proof, ProvenSet};
pub use raytraced as rays;
pub use raytraced::question::*;
pub use rite::{Trial, prove};
pub use seal::{Seal, SealedSet, commitment, hash_folder};
pub use solve::{DATA, Solved};
pub use worlds::seal;

fn main() -> std::process::ExitCode {
    command::main()
}
