//! What was right and what was wrong: [`mark`] judges one set, [`scores`] all of them, and the five
//! endpoints say how far the figures that were chosen beforehand got.

mod advice;
mod endpoints;
mod marks;
mod scores;
mod verdict;

pub use advice::{AdviceMarks, mark_advice};
pub use endpoints::{Endpoint, Level, endpoints_in_words};
pub use marks::{Marks, QUESTIONS, mark};
pub use scores::{ByStrength, Rate, Rates, Ratio, Scores, level, scores, word};
pub use verdict::advised_view;
