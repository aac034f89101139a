//! Oracle tests of the physical effects: what each does to depth images, measured by statistics independent
//! of the effect's code.
//!
//! All random numbers are seeded, so the tests are deterministic; the false-alarm probabilities say how often
//! a correct effect would fail under another seed.

mod bias_in_the_picture;
mod bias_of_depth;
mod catalogue;
mod correlation;
mod distribution;
mod edges;
mod independence;
mod laboratory;
mod missing;
mod variance;
